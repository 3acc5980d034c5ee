"""Distortion: the distortion of a lens differs from the stated one."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.effect import NOT_OF_LENSES, ONE, Effect, LensParameter, SimulatedFault
from basecal.fields.digits import two_digits
from basecal.geometry import Array, Camera

_USUAL = 1e-3  # shift of the farthest corner by each term, as a share of the image's width


def typical_sigmas(camera: Camera) -> Array:
    """Typical errors of the distortion terms: each moves the farthest corner by a share of the image's width."""
    width = camera.size_px[0] if camera.size_px else 2 * camera.parameters[2]
    return _USUAL * width / _corner_by_terms(camera)


def farthest_corner(camera: Camera) -> Array:
    """Ray, (3,), of the image corner farthest from the principal point, of a lens without distortion."""
    fx, fy, cx, cy = camera.parameters[:4]
    width, height = camera.size_px or (2 * cx, 2 * cy)
    return np.array([max(cx, width - cx) / fx, max(cy, height - cy) / fy, 1.0])


def _corner_by_terms(camera: Camera) -> Array:
    """Shift of the farthest corner by a unit of each term, (n,) [px]."""
    plain = camera.with_parameters(np.append(camera.parameters[:4], np.zeros_like(camera.distortion)))
    by_lens = plain.project_with_derivatives(farthest_corner(camera), intrinsics=True)[2]
    assert by_lens is not None
    return np.asarray(np.linalg.norm(by_lens[:, 4:], axis=0))


def words(stated_lens: Camera, estimated_lens: Camera, sigma: Array) -> str:
    """Describe the shift of the farthest corner."""
    corner = farthest_corner(stated_lens)
    bent = stated_lens.with_parameters(np.append(stated_lens.parameters[:4], estimated_lens.parameters[4:]))
    corner_px = float(np.linalg.norm(bent.project(corner) - stated_lens.project(corner)))
    return f"the distortion by {two_digits(corner_px)} px at the corner"


def faulty_lens(size: float, camera: Camera) -> Camera:
    """A lens whose first distortion term is changed so that the farthest corner shifts by `size` [px]."""
    bent = camera.parameters.copy()
    bent[4:5] += size / _corner_by_terms(camera)[:1]
    return camera.with_parameters(bent)


EFFECT = Effect(
    "distortion",
    lens=LensParameter(
        slice(4, None),
        typical_sigmas,
        "assumed: as much at the corner as the principal point is off",
        words,
        is_each_alone=True,  # a lens that is stated without distortion lacks its first term most
    ),
    fault=SimulatedFault(
        "distortion", "px", ONE, 3.0, "larger distortion at the corner of the image", true_lens=faulty_lens
    ),
    absent=NOT_OF_LENSES,
)
