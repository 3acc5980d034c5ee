"""Interface of lens models: the map between points and their image on the plane at unit distance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from basecal.geometry.array import Array, BoolArray

Number = float | Array


class Image(NamedTuple):
    """Image of directions (a, b, 1) on the plane at unit distance, and its derivatives, (...,) each."""

    u: Array
    v: Array
    du_da: Array
    du_db: Array
    dv_da: Array
    dv_db: Array


class Projection(NamedTuple):
    """Image of points on the plane at unit distance, and the derivatives of their pixels.

    Attributes:
        u: Image coordinate along x, (...,).
        v: Image coordinate along y, (...,).
        by_points: Derivative of the pixels with respect to the points, (..., 2, 3) [px/m].
        by_terms: Derivative of the pixels with respect to the distortion terms, (..., 2, k) [px]; None if not
            requested.
    """

    u: Array
    v: Array
    by_points: Array
    by_terms: Array | None


LensMap = Callable[[Array, Array], Image]

# Most Newton steps: convergence is quadratic, but slower near the fold; after these steps there is none.
_MOST_STEPS = 60
_TOLERANCE = 1e-12  # tolerance of the image [focal lengths]: 1e-9 px, above the rounding of the polynomials
# Residual from which the next step ends at rounding, if the determinant is at least this: it needs no check.
_LAST_STEP, _LEAST_DETERMINANT = 1e-7, 0.25
_IMAGINARY_SHARE = 1e-9  # imaginary parts of a root below this share of its size are rounding


class Lens(Protocol):
    """Interface of a lens, a module of `basecal.geometry.lenses`.

    Parameters are floats, or for a batch of lenses arrays that broadcast against the coordinates of the points.

    Attributes:
        MODEL: Name of the model in files; two lenses of one model differ in their numbers of terms.
        TERM_NAMES: Names of the distortion terms, in their order.
        TERMS: Valid numbers of distortion terms.
        TERM_SIGMAS: Typical terms of real lenses, 1 sigma about zero, infinite if not known. They hold for a lens with
            at most as many terms as sigmas. If a lens has more terms, no sigma is known.
        USUAL_TERMS: Default number of terms.
        USUAL_FOCAL_PX: Least and greatest focal length of simulated lenses, for an image 1280 px wide [px].
    """

    MODEL: str
    TERM_NAMES: tuple[str, ...]
    TERMS: tuple[int, ...]
    TERM_SIGMAS: tuple[float, ...]
    USUAL_TERMS: int
    USUAL_FOCAL_PX: tuple[float, float]

    def usual_distortion(self, rng: np.random.Generator) -> Array:
        """Draw distortion terms for a simulation, (USUAL_TERMS,)."""

    def project(self, points: Array, distortion: Sequence[Number]) -> tuple[Array, Array]:
        """Image u and v, (...,) each, of points (..., 3); NaN if the lens does not map the point."""

    def project_with_derivatives(
        self, points: Array, focal: tuple[Number, Number], distortion: Sequence[Number], with_terms: bool
    ) -> Projection:
        """Image of points, (..., 3), with derivatives of the pixels, also by the distortion terms if `with_terms`."""

    def domain_mask(self, points: Array, distortion: list[float]) -> BoolArray:
        """Whether points are in the domain where the model is injective, (...,)."""

    def unproject(self, u: Array, v: Array, distortion: list[float]) -> tuple[Array, BoolArray]:
        """Directions of any length, (..., 3), with the image (u, v), and whether each is in the domain, (...,)."""


def invert_map(mapping: LensMap, u: Array, v: Array, limit: float) -> tuple[Array, BoolArray]:
    """Invert a lens map: directions (a, b, 1), (..., 3), with the image (u, v), and whether each is valid, (...,).

    Newton's method, with the image as the initial guess and steps clipped to the limit. A direction is valid if the
    iteration has converged inside the limit.

    Args:
        mapping: Function of a and b, (...,) each, that returns their image and its derivatives.
        u: Image coordinate along x, (...,).
        v: Image coordinate along y, (...,).
        limit: The map is injective for a^2 + b^2 below this limit.
    """
    a, b = _clip_direction(u, v, limit)
    size = _TOLERANCE * (1 + np.sqrt(u * u + v * v))
    for _ in range(_MOST_STEPS):
        image = mapping(a, b)
        solution, miss_u, miss_v = (a, b), u - image.u, v - image.v
        determinant = image.du_da * image.dv_db - image.du_db * image.dv_da
        square = miss_u * miss_u + miss_v * miss_v
        converged = square <= size * size
        if not np.any(np.isfinite(determinant) & ~converged):
            break
        step_a = (image.dv_db * miss_u - image.du_db * miss_v) / determinant
        step_b = (image.du_da * miss_v - image.dv_da * miss_u) / determinant
        a, b = _clip_direction(a + step_a, b + step_b, limit)
        if not np.any((square > _LAST_STEP**2) | (determinant < _LEAST_DETERMINANT)):  # NaN stays NaN
            solution, converged = (a, b), np.isfinite(determinant)
            break
    valid = converged & (determinant > 0) & (image.du_da + image.dv_db > 0)
    return np.stack([*solution, np.ones_like(solution[0])], -1), valid


def _clip_direction(a: Array, b: Array, limit: float) -> tuple[Array, Array]:
    s = a * a + b * b
    outside = s > limit
    if not outside.any():
        return a, b
    shrink = np.where(outside, np.sqrt(limit / s), 1.0)
    return a * shrink, b * shrink


def first_root(coefficients: Array) -> float:
    """Smallest positive root of 1 + c1 s + c2 s^2 + ..., or infinity.

    The equivalent polynomial in 1 / s is monic, so that small coefficients cannot cause an overflow.
    """
    degree = int(np.flatnonzero(coefficients)[-1])
    if not degree:
        return float("inf")
    companion = np.eye(degree, k=-1)
    companion[0] = -coefficients[1 : degree + 1]
    reciprocals = np.linalg.eigvals(companion)
    real = reciprocals.real[np.abs(reciprocals.imag) <= _IMAGINARY_SHARE * np.abs(reciprocals)]
    largest = float(real.max(initial=0.0))
    return 1.0 / largest if largest > 0 else float("inf")


def any_nonzero(numbers: Sequence[Number]) -> bool:
    """Whether any number is not zero, for any lens of a batch."""
    return any(bool(number) if isinstance(number, float) else bool(np.any(number)) for number in numbers)
