"""Pinhole lens with OpenCV's thin prism terms s1 s2 s3 s4, for a tilted sensor or tilted lens elements.

With s = a^2 + b^2 the image of (a, b, 1) is the pinhole's plus (s1 s + s2 s^2, s3 s + s4 s^2). Its Jacobian is not
symmetric. Source: Weng, Cohen & Herniou 1992, doi:10.1109/34.159901, in OpenCV's order.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.geometry.array import Array, BoolArray
from basecal.geometry.lens import Image, Number, Projection, invert_map
from basecal.geometry.lenses import pinhole

MODEL = "pinhole"
TERM_NAMES = (*pinhole.TERM_NAMES, "s1", "s2", "s3", "s4")
TERMS: tuple[int, ...] = (12,)
TERM_SIGMAS: tuple[float, ...] = ()
USUAL_TERMS = 12
USUAL_FOCAL_PX = pinhole.USUAL_FOCAL_PX
_RADIAL_TERMS = 8


def project(points: Array, distortion: Sequence[Number]) -> tuple[Array, Array]:
    """Image on the plane at unit distance, (...,) each, of points (..., 3); NaN if z <= 0."""
    a, b, _ = pinhole.normalise(points)
    u, v = pinhole.project(points, distortion[:_RADIAL_TERMS])
    s1, s2, s3, s4 = distortion[_RADIAL_TERMS:]
    s = a * a + b * b
    return u + s * (s1 + s2 * s), v + s * (s3 + s4 * s)


def project_with_derivatives(
    points: Array, focal: tuple[Number, Number], distortion: Sequence[Number], with_terms: bool
) -> Projection:
    """See `Lens`."""
    a, b, inverse = pinhole.normalise(points)
    u, v, d_points, d_terms = pinhole.project_with_derivatives(points, focal, distortion[:_RADIAL_TERMS], with_terms)
    s1, s2, s3, s4 = distortion[_RADIAL_TERMS:]
    s = a * a + b * b
    for row, (f, first, second) in enumerate(((focal[0], s1, s2), (focal[1], s3, s4))):
        slope = 2 * f * (first + 2 * second * s) * inverse
        d_points[..., row, 0] += slope * a
        d_points[..., row, 1] += slope * b
        d_points[..., row, 2] -= slope * s
    u, v = u + s * (s1 + s2 * s), v + s * (s3 + s4 * s)
    d_terms = None if d_terms is None else np.concatenate([d_terms, _term_derivative(s, focal)], axis=-1)
    return Projection(u, v, d_points, d_terms)


def _term_derivative(s: Array, focal: tuple[Number, Number]) -> Array:
    """Derivative of the pixels with respect to the last four terms, (..., 2, 4)."""
    out = pinhole.allocate_rows(2, 4, s.shape)
    out[...] = 0.0
    for row in (0, 1):
        out[..., row, 2 * row] = focal[row] * s
        out[..., row, 2 * row + 1] = focal[row] * s * s
    return out


def domain_mask(points: Array, distortion: list[float]) -> BoolArray:
    """Whether points are in front of the camera and inside the fold of the radial terms, (...,)."""
    return pinhole.domain_mask(points, distortion[:_RADIAL_TERMS])


def unproject(u: Array, v: Array, distortion: list[float]) -> tuple[Array, BoolArray]:
    """Directions (a, b, 1), (..., 3), with the image (u, v), and whether each is inside the fold, (...,)."""
    s1, s2, s3, s4 = distortion[_RADIAL_TERMS:]

    def project_direction(a: Array, b: Array) -> Image:
        """Image of a direction and its derivatives: those of the pinhole plus those of the prism terms."""
        image, s = pinhole.project_direction(a, b, distortion[:_RADIAL_TERMS]), a * a + b * b
        for_u, for_v = 2 * (s1 + 2 * s2 * s), 2 * (s3 + 2 * s4 * s)
        image_u, image_v = image.u + s * (s1 + s2 * s), image.v + s * (s3 + s4 * s)
        return Image(
            image_u,
            image_v,
            image.du_da + for_u * a,
            image.du_db + for_u * b,
            image.dv_da + for_v * a,
            image.dv_db + for_v * b,
        )

    return invert_map(project_direction, u, v, pinhole.fold(distortion[:_RADIAL_TERMS]))


def usual_distortion(rng: np.random.Generator) -> Array:
    """Draw distortion terms for a simulation, (12,): pinhole terms without rational ones, and slight prism terms."""
    return np.concatenate(
        [pinhole.usual_distortion(rng), np.zeros(3), rng.uniform(-1, 1, 4) * (2e-3, 5e-4, 2e-3, 5e-4)]
    )
