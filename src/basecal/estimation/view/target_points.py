"""Common parts of measurements of a target's points: their model in the camera, and sums over them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from basecal.errors import InputError
from basecal.estimation.view.measurement import ViewInformation, limit_equations
from basecal.estimation.view.moments import Monomials, gradient_and_information
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows
from basecal.geometry.array import to_back, to_front
from basecal.numerics.batch import SHARED, take
from basecal.numerics.spectral import dimension


@dataclass(frozen=True, eq=False)
class TargetPoints:
    """Points of one target as one camera measured them in some views.

    Attributes:
        points_in_target: (p, 3) [m].
    """

    points_in_target: Array = field(metadata=SHARED)

    def camera_points(self, camera_from_target: SE3) -> Array:
        """Points in the camera, (..., n, p, 3), those of one coordinate side by side in memory."""
        return self.translate(camera_from_target, self.turn(camera_from_target))

    def turn(self, camera_from_target: SE3) -> Array:
        """Points from the target's origin in the camera's axes, (3, ..., n, p)."""
        return to_front(camera_from_target.rotation, -2) @ self.points_in_target.T

    def translate(self, camera_from_target: SE3, turned_points: Array) -> Array:
        """Points in the camera, (..., n, p, 3), of what `turned_points` gave."""
        return to_back(turned_points + to_front(camera_from_target.translation, -1)[..., None])

    def information(
        self, cost: Array, forces: Iterable[Array], squares: Iterable[Array], rotation: Array
    ) -> ViewInformation:
        """Information of views of known cost, by the sums of `gradient_and_information` over their points."""
        return ViewInformation(cost, *gradient_and_information(forces, squares, rotation, self._monomials))

    @cached_property
    def _monomials(self) -> Monomials:
        return Monomials.from_points(self.points_in_target)

    def take(self, views: Rows) -> Self:
        """See `Measurement`."""
        return take(self, views)


def spread_rows(points: Array, max_count: int) -> IntArray:
    """Rows, rising, of at most so many of points (p, 3): every so manyth, or those far apart where these span less.

    Every eleventh point of a grid of eleven columns is one of its columns.
    """
    every = np.arange(0, len(points), -(-len(points) // max_count))
    if dimension(points[every]) == dimension(points):
        return every
    rows = [int(np.argmax(np.sum((points - points.mean(0)) ** 2, -1)))]
    apart = np.full(len(points), np.inf)
    while len(rows) < max_count:
        apart = np.minimum(apart, np.sum((points - points[rows[-1]]) ** 2, -1))
        rows.append(int(np.argmax(apart)))
    return np.sort(np.array(rows))


def require_camera(camera: Camera | None) -> Camera:
    """The camera, without which pixels say nothing.

    Raises:
        InputError: if there is none.
    """
    if camera is None:
        raise InputError("pixels say nothing without the camera's lens")
    return camera


class MeasuredPoints(TargetPoints):
    """Points of one target as one camera measured them in some views; the methods are those of `Measurement`.

    Attributes:
        weight: ([b,] n, p) 1 / sigma of a coordinate in use, 0 if the point was not seen.
        coordinates: How many a point has.
        axes: How many axes each array has that may have one of a batch before them.
    """

    weight: Array
    coordinates: ClassVar[int]
    axes: ClassVar[Mapping[str, int]]

    def take_batch(self, rows: Rows | int) -> Self:
        """See `Measurement`."""
        arrays = {name: getattr(self, name) for name in self.axes}
        batched = {name: of[rows] for name, of in arrays.items() if of is not None and of.ndim > self.axes[name]}
        return self._with(**batched)

    def noisier(self, factor: float) -> Self:
        """See `Measurement`."""
        return self._with(weight=self.weight / factor)

    def mask_points(self, points: BoolArray) -> Self:
        """See `Measurement`."""
        return self._with(weight=np.where(points, self.weight, 0.0))

    def without_sigmas(self) -> Self:
        """See `Measurement`."""
        return self

    def point_counts(self) -> IntArray:
        """See `Measurement`."""
        return np.asarray(np.count_nonzero(self.weight, axis=-1), dtype=np.int64)

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return limit_equations(self.coordinates * self.point_counts())

    def _with(self, **changed: Any) -> Self:
        return replace(self, **changed)
