"""The error of a lens that is stated without sigmas: that of a usual calibration, or as large as the data show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Intrinsics
from basecal.effects.registry import LENS_PARAMETERS
from basecal.geometry import Array, Camera

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
    return np.concatenate([part.usual(camera) for part in LENS_PARAMETERS.values()])


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
    blocks = (squares[part.where] for part in LENS_PARAMETERS.values())
    ratios = [np.full(len(of), (_FREEDOMS + of.sum()) / (_FREEDOMS + len(of))) for of in blocks]
    return np.asarray(usual * np.sqrt(np.maximum(np.concatenate(ratios), 1.0)))
