"""The interface of lens models: the map between points and their image on the plane at unit distance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from basecal.geometry.array import Array

BoolArray = NDArray[np.bool_]
Number = float | Array


class Image(NamedTuple):
    """Where directions (a, b, 1) are on the plane at unit distance, and the derivatives of that, (...,) each."""

    u: Array
    v: Array
    du_da: Array
    du_db: Array
    dv_da: Array
    dv_db: Array


class Projection(NamedTuple):
    """The image of points on the plane at unit distance, u and v, (...,) each, and the derivatives of their pixels.

    Attributes:
        u: Along x.
        v: Along y.
        by_points: To the points, (..., 2, 3) [px/m].
        by_terms: To the distortion terms, (..., 2, k) [px]; None if they were not requested.
    """

    u: Array
    v: Array
    by_points: Array
    by_terms: Array | None


Mapped = Callable[[Array, Array], Image]

# Newton's method doubles its digits; a start near the fold takes longer, and one that has not come by then does not.
_MOST_STEPS = 60
_TOLERANCE = 1e-12  # of the image [focal lengths]: 1e-9 px, above the rounding of the polynomials
# Where the image grows by half or more, from so near the next step ends at rounding: it need not be looked at.
_LAST_STEP, _LEAST_DETERMINANT = 1e-7, 0.25
_IMAGINARY_SHARE = 1e-9  # imaginary parts of a root below this share of it are rounding


class Lens(Protocol):
    """The face of a lens, a module of `basecal.geometry.lenses`.

    A lens's numbers are floats, or over a batch of lenses arrays that broadcast against the coordinates of the points.

    Attributes:
        MODEL: What its model is called in files; two lenses of one model differ in their numbers of terms.
        TERM_NAMES: Of its distortion terms, in their order.
        TERMS: How many of them it may have.
        TERM_SIGMAS: How large the terms of real lenses are, 1 sigma about zero, infinite if they may be anything. They
            hold for a lens with at most so many terms. If a lens has more, all its terms may be anything.
        USUAL_TERMS: How many it has where nothing is said.
        USUAL_FOCAL_PX: Least and greatest focal length, in an image 1280 px wide, of one that a simulation draws.
    """

    MODEL: str
    TERM_NAMES: tuple[str, ...]
    TERMS: tuple[int, ...]
    TERM_SIGMAS: tuple[float, ...]
    USUAL_TERMS: int
    USUAL_FOCAL_PX: tuple[float, float]

    def usual_distortion(self, rng: np.random.Generator) -> Array:
        """Distortion terms as a simulation draws them, (USUAL_TERMS,)."""

    def project(self, points: Array, distortion: Sequence[Number]) -> tuple[Array, Array]:
        """Image u and v, (...,) each, of points (..., 3); NaN if the lens is not defined."""

    def project_with_derivatives(
        self, points: Array, focal: tuple[Number, Number], distortion: Sequence[Number], terms: bool
    ) -> Projection:
        """The image of points, (..., 3), and the derivatives of the pixels, to the distortion if `terms`."""

    def domain_mask(self, points: Array, distortion: list[float]) -> BoolArray:
        """Whether points lie where the model is one to one, (...,)."""

    def unproject(self, u: Array, v: Array, distortion: list[float]) -> tuple[Array, BoolArray]:
        """Directions of any length, (..., 3), and whether each has the image (u, v) where the model is one to one."""


def invert_map(mapping: Mapped, u: Array, v: Array, limit: float) -> tuple[Array, BoolArray]:
    """Directions (a, b, 1), (..., 3), and whether each has the image (u, v) where a^2 + b^2 < limit, (...,).

    Newton's method from the image itself, kept inside the limit.

    Args:
        mapping: From a and b, (...,) each, to their image and its derivative.
        u: Of the image, (...,).
        v: Likewise.
        limit: How far out the map is one to one.
    """
    a, b = _clip_direction(u, v, limit)
    size = _TOLERANCE * (1 + np.sqrt(u * u + v * v))
    for _ in range(_MOST_STEPS):
        at = mapping(a, b)
        here, miss_u, miss_v = (a, b), u - at.u, v - at.v
        determinant = at.du_da * at.dv_db - at.du_db * at.dv_da
        square = miss_u * miss_u + miss_v * miss_v
        near = square <= size * size
        if not np.any(np.isfinite(determinant) & ~near):
            break
        step_a = (at.dv_db * miss_u - at.du_db * miss_v) / determinant
        step_b = (at.du_da * miss_v - at.dv_da * miss_u) / determinant
        a, b = _clip_direction(a + step_a, b + step_b, limit)
        if not np.any((square > _LAST_STEP**2) | (determinant < _LEAST_DETERMINANT)):  # what is no number stays none
            here, near = (a, b), np.isfinite(determinant)
            break
    valid = near & (determinant > 0) & (at.du_da + at.dv_db > 0)
    return np.stack([*here, np.ones_like(here[0])], -1), valid


def _clip_direction(a: Array, b: Array, limit: float) -> tuple[Array, Array]:
    s = a * a + b * b
    outside = s > limit
    if not outside.any():
        return a, b
    shrink = np.where(outside, np.sqrt(limit / s), 1.0)
    return a * shrink, b * shrink


def first_root(rising: Array) -> float:
    """Smallest positive root of 1 + c1 s + c2 s^2 + ..., or infinity.

    Its mirror image in 1 / s is monic, so that no coefficient, however small, overflows.
    """
    degree = int(np.flatnonzero(rising)[-1])
    if not degree:
        return float("inf")
    companion = np.eye(degree, k=-1)
    companion[0] = -rising[1 : degree + 1]
    mirrored = np.linalg.eigvals(companion)
    real = mirrored.real[np.abs(mirrored.imag) <= _IMAGINARY_SHARE * np.abs(mirrored)]
    largest = float(real.max(initial=0.0))
    return 1.0 / largest if largest > 0 else float("inf")


def any_nonzero(numbers: Sequence[Number]) -> bool:
    """Whether any of these is not zero, for any lens of a batch."""
    return any(bool(number) if isinstance(number, float) else bool(np.any(number)) for number in numbers)
