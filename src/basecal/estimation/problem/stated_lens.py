"""The error of a lens that is stated without sigmas: that of a usual calibration, or as large as the data show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Intrinsics
from basecal.geometry import Array, Camera

_BLOCKS = slice(0, 2), slice(2, 4), slice(4, None)
"""Of a lens's parameters: focal lengths, principal point, distortion. Each has an error of its own size."""

# Assumed. Calibrations of one lens by boards differ by some tenths of a percent and a pixel or two; a principal point
# that counts from the corner of the first pixel, not from its centre, is half a pixel off, and (w + 1) / 2 a whole one.
_FOCAL = 2e-3  # of the focal length
_CENTRE = 1e-3  # of the width of the image
_DISTORTION = 1e-3  # of the width of the image, of each term at the farthest corner
_FREEDOMS = 3.0  # of Student's t: one lens of twenty is off by more than three times these


def with_usual_error(lens: Intrinsics) -> Intrinsics:
    """A lens that is stated without sigmas as a prior with those of a usual calibration; others as they are."""
    if not is_stated(lens) or lens.camera is None:
        return lens
    return replace(lens, status="prior", sigma=usual_sigmas(lens.camera))


def is_stated(lens: Intrinsics | None) -> bool:
    """Whether a lens is stated without sigmas, and not as exact."""
    return lens is not None and lens.status == "fixed" and not lens.exact


def usual_sigmas(camera: Camera) -> Array:
    """Of the errors of a usual calibration: of focal lengths, principal point and distortion terms, (4 + k,)."""
    fx, fy, cx, _ = camera.parameters[:4]
    width = camera.size_px[0] if camera.size_px else 2 * cx
    undistorted = camera.with_parameters(np.append(camera.parameters[:4], np.zeros_like(camera.distortion)))
    by_lens = undistorted.project_with_derivatives(farthest_corner(camera), intrinsics=True)[2]
    assert by_lens is not None
    terms = _DISTORTION * width / np.linalg.norm(by_lens[:, 4:], axis=0)
    return np.concatenate([[_FOCAL * fx, _FOCAL * fy, _CENTRE * width, _CENTRE * width], terms])


def farthest_corner(camera: Camera) -> Array:
    """The direction, (3,), that a lens without distortion sees in the corner farthest from its principal point."""
    fx, fy, cx, cy = camera.parameters[:4]
    width, height = camera.size_px or (2 * cx, 2 * cy)
    return np.array([max(cx, width - cx) / fx, max(cy, height - cy) / fy, 1.0])


def likely_sigmas(lens: Intrinsics, camera: Camera, covariance: Array) -> Array:
    """Sigmas of the errors of a stated lens, given the data, (4 + k,): the usual ones or larger.

    The errors of each block are Student's t: a normal whose variance is estimated by the mean of the squares that are
    expected of them, given the data. Source: Dempster, Laird & Rubin 1980 (expectation maximisation).

    Args:
        lens: As stated.
        camera: As estimated with the usual sigmas, or wider ones.
        covariance: Of its parameters, (4 + k, 4 + k).
    """
    assert lens.camera is not None
    usual = usual_sigmas(lens.camera)
    squares = ((camera.parameters - lens.camera.parameters) ** 2 + np.diag(covariance)) / usual**2
    blocks = (squares[block] for block in _BLOCKS)
    ratios = [np.full(len(of), (_FREEDOMS + of.sum()) / (_FREEDOMS + len(of))) for of in blocks]
    return np.asarray(usual * np.sqrt(np.maximum(np.concatenate(ratios), 1.0)))
