"""Interface of measurements of `camera_from_target`: cost, gradient and information of each view.

With residuals r(delta) of `camera_from_target @ SE3.exp(delta)`, already divided by their sigmas, a view has
`cost = r'r`, `gradient = J'r` and `information = J'J`. A free lens adds k columns.
Source: docs/mathematics.md (2.1), (2.2), (2.7).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows


class ViewInformation(NamedTuple):
    """Cost (..., n), gradient (..., n, 6 + k) and information (..., n, 6 + k, 6 + k) of each view."""

    cost: Array
    gradient: Array
    information: Array

    @property
    def hessian(self) -> Array:
        """The information, under the name that Levenberg-Marquardt uses: half the second derivative of the cost."""
        return self.information

    @property
    def eliminated_cost(self) -> float:
        """Zero, since no unknown is eliminated; used by Levenberg-Marquardt."""
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

    Measured values, poses and the lens may have a leading batch axis; entries of the batch correspond.
    """

    def linearise(self, camera_from_target: SE3, camera: Camera | None, with_lens: bool) -> ViewInformation:
        """Linearise the views at `camera_from_target`, (..., n); with columns of the lens if `with_lens`."""
        ...

    def take_batch(self, rows: Rows) -> Measurement:
        """Select entries of a batch; measurements without a batch axis are shared."""
        ...

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """Sums of squared residuals over sigmas, of residuals without stated sigma, by field of `Noise`."""
        ...

    def with_noise(self, noise: Noise) -> Measurement:
        """Return a copy with sigmas for unstated noise."""
        ...

    def noisier(self, factor: float) -> Measurement:
        """Return a copy with all sigmas in use, stated or not, multiplied by a factor."""
        ...

    def mask_points(self, points: BoolArray) -> Measurement:
        """Return a copy in which only the points of a mask (n, p) are seen; measured poses stay unchanged."""
        ...

    def without_sigmas(self) -> Measurement:
        """Return a copy without stated sigmas; the relative weights of pixels are kept."""
        ...

    def point_counts(self) -> IntArray:
        """Number of points seen in each view, (n,); 0 for measured poses."""
        ...

    def take(self, views: Rows) -> Measurement:
        """Select views by index."""
        ...

    def counts(self) -> dict[str, int]:
        """Number of scalar residuals without stated sigma, by field of `Noise`, and with stated sigma, as `stated`."""
        ...

    def equations(self) -> IntArray:
        """Number of degrees of freedom of `camera_from_target` that each view can determine, (n,), at most six."""
        ...


def make_information(residual: Array, jacobian: Array) -> ViewInformation:
    """Make information from residuals (..., m) and the transpose of their Jacobian, (..., k, m)."""
    gradient = (jacobian @ residual[..., None])[..., 0]
    return ViewInformation(np.einsum("...i,...i->...", residual, residual), gradient, jacobian @ jacobian.mT)


def take_batch_rows(values: Array, rows: Rows | int, axes: int) -> Array:
    """Select entries of a batch of values; values with only `axes` axes have no batch axis and stay unchanged."""
    return values[rows] if values.ndim > axes else values


def sums_of_squares(residual: Sequence[Array]) -> Array:
    """Sum of squares of each view over several arrays (..., p), (...,)."""
    total: Array = sum(np.einsum("...p,...p->...", r, r) for r in residual)
    return total


def limit_equations(equations: IntArray) -> IntArray:
    """Limit numbers of equations to six, the degrees of freedom of a pose."""
    return np.minimum(equations, 6).astype(np.int64)
