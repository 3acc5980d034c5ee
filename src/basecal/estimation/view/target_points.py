"""Common parts of measurements of a target's points: their model in the camera, and sums over them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np

from basecal.errors import InputError
from basecal.estimation.view.measurement import ViewInformation
from basecal.estimation.view.moments import Monomials, gradient_and_information
from basecal.geometry import SE3, Array, Camera, IntArray, Rows
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
