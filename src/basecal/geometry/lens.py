"""What every lens model does: the map between points and their image on the plane at unit distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from basecal.geometry.array import Array

BoolArray = NDArray[np.bool_]
Number = float | Array


class Lens(Protocol):
    """The face of a lens model, a module; camera.py keeps the list of them.

    A lens's numbers are floats, or over a batch of lenses arrays that broadcast against the coordinates of the points.
    """

    TERMS: tuple[int, ...]

    def project(self, points: Array, distortion: Sequence[Number]) -> tuple[Array, Array]:
        """Image u and v, (...,) each, of points (..., 3); NaN where the lens is not defined."""

    def project_with_derivatives(
        self, points: Array, focal: tuple[Number, Number], distortion: Sequence[Number], terms: bool
    ) -> tuple[Array, Array, Array, Array | None]:
        """Image u and v, and the derivatives of the pixels.

        To points, (..., 2, 3), and if `terms` to the distortion, (..., 2, k).
        """

    def within(self, points: Array, distortion: list[float]) -> BoolArray:
        """Whether points lie where the model is one to one, (...,)."""

    def unproject(self, u: Array, v: Array, distortion: list[float]) -> tuple[Array, BoolArray]:
        """Directions of any length, (..., 3), and whether each has the image (u, v) where the model is one to one."""


def first_root(rising: Array) -> float:
    """Smallest positive root of 1 + c1 s + c2 s^2 + ..., or infinity.

    Its mirror image in 1 / s is monic, so that no coefficient, however small, overflows.
    """
    mirrored = np.roots(rising)
    real = mirrored.real[np.abs(mirrored.imag) <= 1e-9 * np.abs(mirrored)]
    largest = float(real.max(initial=0.0))
    return 1.0 / largest if largest > 0 else float("inf")


def any_nonzero(numbers: Sequence[Number]) -> bool:
    """Whether any of these is not zero, for any lens of a batch."""
    return any(bool(number) if isinstance(number, float) else bool(np.any(number)) for number in numbers)
