"""What every lens model does: the map between points and their image on the plane at unit distance."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from basecal.geometry.array import Array

BoolArray = NDArray[np.bool_]


class Lens(Protocol):
    """The face of a lens model, a module; camera.py keeps the list of them."""

    TERMS: tuple[int, ...]

    def project(self, points: Array, distortion: list[float]) -> tuple[Array, Array]:
        """Image u and v, (...,) each, of points (..., 3); NaN where the lens is not defined."""

    def project_with_derivatives(
        self, points: Array, focal: tuple[float, float], distortion: list[float], terms: bool
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
