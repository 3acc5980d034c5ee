"""The measurement of `camera_from_target` by one view: cost, gradient and information.

With residuals r(delta) of `camera_from_target @ SE3.exp(delta)`, already divided by their sigmas, a view gives
`cost = r'r`, `gradient = J'r` and `information = J'J`. A few more columns represent the lens if it is free.
Source: docs/mathematics.md (2.1), (2.2), (2.7).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows


class ViewInformation(NamedTuple):
    """Per view: cost (..., n), gradient (..., n, 6 + k), information (..., n, 6 + k, 6 + k)."""

    cost: Array
    gradient: Array
    information: Array

    @property
    def hessian(self) -> Array:
        """Half the second derivative of the cost, as Levenberg-Marquardt calls it: the information."""
        return self.information

    @property
    def eliminated_cost(self) -> float:
        """Zero: no unknown is eliminated, as Levenberg-Marquardt asks."""
        return 0.0


class Noise(NamedTuple):
    """Sigmas of unstated noise: a pixel coordinate [px], a pose [m, rad], a 3-D point, a touch [m], a grip [rad]."""

    pixel_px: float = 1.0
    pose_m: float = 1e-3
    pose_rad: float = 1e-3
    point_m: float = 1e-3
    touch_m: float = 1e-3
    grip_rad: float = 1e-3


class Measurement(Protocol):
    """All views of one target by one camera.

    What was seen may have a leading batch axis, as poses and the lens may: then each entry is seen from its own.
    """

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """The linearised views at `camera_from_target`, (..., n); with the lens's columns if `lens`."""
        ...

    def take_batch(self, rows: Rows) -> Measurement:
        """The views of these rows of a batch; shared if all rows saw the same."""
        ...

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """Sums of squared residuals over sigmas of what states no sigma, by field of `Noise`."""
        ...

    def with_noise(self, noise: Noise) -> Measurement:
        """A copy with the sigmas that were not stated."""
        ...

    def noisier(self, factor: float) -> Measurement:
        """A copy with all sigmas in use, stated or not, so many times as large."""
        ...

    def mask_points(self, points: BoolArray) -> Measurement:
        """A copy as if points (n, p) that are not kept had not been seen; poses stay."""
        ...

    def without_sigmas(self) -> Measurement:
        """A copy with no sigma stated; how points of a view compare with one another is kept."""
        ...

    def point_counts(self) -> IntArray:
        """How many points each view shows, (n,); 0 of poses."""
        ...

    def take(self, views: Rows) -> Measurement:
        """The views at these indices."""
        ...

    def counts(self) -> dict[str, int]:
        """How many scalar residuals state no sigma, by field of `Noise`; and `stated`."""
        ...

    def equations(self) -> IntArray:
        """How many of the six freedoms of `camera_from_target` each view can hold, (n,)."""
        ...


def make_information(residual: Array, jacobian: Array) -> ViewInformation:
    """Information from residuals (..., m) and their derivative by rows of unknowns, (..., k, m)."""
    gradient = (jacobian @ residual[..., None])[..., 0]
    return ViewInformation(np.einsum("...i,...i->...", residual, residual), gradient, jacobian @ jacobian.mT)


def take_batch_rows(values: Array, rows: Rows | int, axes: int) -> Array:
    """The rows of a batch, of values that have so many axes without one."""
    return values[rows] if values.ndim > axes else values


def sums_of_squares(residual: Sequence[Array]) -> Array:
    """Each view's sum of squares over arrays (..., p)."""
    total: Array = sum(np.einsum("...p,...p->...", r, r) for r in residual)
    return total


def limit_equations(equations: IntArray) -> IntArray:
    """No more equations than a pose has freedoms."""
    return np.minimum(equations, 6).astype(np.int64)
