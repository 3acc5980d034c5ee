"""Common base of measurements of a target's points: points in the camera, and sums over points."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from basecal.errors import InputError
from basecal.estimation.view.measurement import Noise, ViewInformation, limit_equations
from basecal.estimation.view.moments import Monomials, gradient_and_information
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows
from basecal.geometry.array import to_back, to_front
from basecal.numerics.batch import SHARED, take
from basecal.numerics.spectral import dimension


@dataclass(frozen=True, eq=False)
class TargetPoints:
    """Points of one target, and their positions in the camera at given poses.

    Attributes:
        points_in_target: (p, 3) points in the target's frame [m].
    """

    points_in_target: Array = field(metadata=SHARED)

    def camera_points(self, camera_from_target: SE3) -> Array:
        """Points in the camera, (..., n, p, 3) [m], with each coordinate contiguous in memory."""
        return self.translate(camera_from_target, self.rotate_points(camera_from_target))

    def rotate_points(self, camera_from_target: SE3) -> Array:
        """Points relative to the target's origin in the camera's axes, (3, ..., n, p) [m]."""
        return to_front(camera_from_target.rotation, -2) @ self.points_in_target.T

    def translate(self, camera_from_target: SE3, rotated_points: Array) -> Array:
        """Points in the camera, (..., n, p, 3) [m], from the result of `rotate_points`."""
        return to_back(rotated_points + to_front(camera_from_target.translation, -1)[..., None])

    def information(
        self, cost: Array, forces: Iterable[Array], squares: Iterable[Array], rotation: Array
    ) -> ViewInformation:
        """Make the information of views from their cost and the arguments of `gradient_and_information`."""
        return ViewInformation(cost, *gradient_and_information(forces, squares, rotation, self._monomials))

    @cached_property
    def _monomials(self) -> Monomials:
        return Monomials.from_points(self.points_in_target)

    def take(self, views: Rows) -> Self:
        """See `Measurement`."""
        return take(self, views)


def spread_rows(points: Array, max_count: int) -> IntArray:
    """Sorted rows of at most `max_count` well-distributed points (p, 3).

    Every k-th point is taken if these span as many dimensions as all points. Otherwise, such as for every eleventh
    point of a grid with eleven columns, farthest-point sampling is used.
    """
    regular = np.arange(0, len(points), -(-len(points) // max_count))
    if dimension(points[regular]) == dimension(points):
        return regular
    rows = [int(np.argmax(np.sum((points - points.mean(0)) ** 2, -1)))]
    distances = np.full(len(points), np.inf)
    while len(rows) < max_count:
        distances = np.minimum(distances, np.sum((points - points[rows[-1]]) ** 2, -1))
        rows.append(int(np.argmax(distances)))
    return np.sort(np.array(rows))


def require_camera(camera: Camera | None) -> Camera:
    """Check that there is a camera, and return it.

    Raises:
        InputError: if the camera is None.
    """
    if camera is None:
        raise InputError("pixels need the lens of the camera: state its intrinsics")
    return camera


class MeasuredPoints(TargetPoints):
    """Points of one target measured by one camera; implements the methods of `Measurement`.

    Attributes:
        weight: ([b,] n, p) 1 / sigma in use of each coordinate, 0 if the point was not seen.
        coordinates: Number of measured coordinates of a point.
        axes: Number of axes of each array, without the batch axis that it may have.
    """

    weight: Array
    coordinates: ClassVar[int]
    axes: ClassVar[Mapping[str, int]]

    def take_batch(self, rows: Rows | int) -> Self:
        """See `Measurement`."""
        arrays = {name: getattr(self, name) for name in self.axes}
        batched = {
            name: array[rows] for name, array in arrays.items() if array is not None and array.ndim > self.axes[name]
        }
        return self._with(**batched)

    def take_points(self, rows: Rows) -> Self:
        """Return a copy with the measured values at these indices of points; `points_in_target` stays unchanged."""
        arrays = {name: getattr(self, name) for name in self.axes}
        return self._with(**{name: array[:, rows] for name, array in arrays.items() if array is not None})

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


class SeenPoints(MeasuredPoints):
    """Points of one target measured by one camera, with a visibility mask.

    Attributes:
        seen: ([b,] n, p) whether the point was seen.
        stated: ([b,] n, p) 1 / sigma of each coordinate, or 0 if none was stated.
        noise_field: Field of `Noise` that is the sigma of coordinates without stated sigma.
    """

    seen: BoolArray
    stated: Array
    noise_field: ClassVar[str]

    @abstractmethod
    def linearise(self, camera_from_target: SE3, camera: Camera | None, with_lens: bool) -> ViewInformation:
        """See `Measurement`."""

    @abstractmethod
    def with_noise(self, noise: Noise) -> Self:
        """See `Measurement`."""

    @abstractmethod
    def residuals(self, camera_from_target: SE3, camera: Camera | None) -> Array:
        """Predicted minus measured coordinates, (n, p, d).

        They are not finite if a point cannot be seen, and arbitrary if it was not seen.
        """

    @abstractmethod
    def with_derivatives(
        self, points_in_camera: Array, camera: Camera | None, with_lens: bool
    ) -> tuple[Array, Array, Array | None]:
        """Residuals of points (n, p, 3), with derivatives by points, (n, p, d, 3), and by the lens if `with_lens`."""

    def tangent_rows(
        self, camera_from_target: SE3, camera: Camera | None, with_lens: bool
    ) -> tuple[Array, Array, Array | None]:
        """Residuals at poses (n,), with derivatives by right tangents, (n, p, d, 6), and by the lens if `with_lens`."""
        residuals, by_point, by_lens = self.with_derivatives(self.camera_points(camera_from_target), camera, with_lens)
        # Derivative of f(camera_from_target @ p) from df/dp, (n, p, d, 3).
        by_translation = by_point @ camera_from_target.rotation[:, None]
        return (
            residuals,
            np.concatenate([by_translation, np.cross(self.points_in_target[:, None], by_translation)], -1),
            by_lens,
        )

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`."""
        unstated = self.weight * (self.stated == 0)
        residuals = np.nan_to_num(self.residuals(camera_from_target, camera)) * unstated[..., None]
        return {self.noise_field: float(np.sum(residuals**2))}

    def mask_points(self, points: BoolArray) -> Self:
        """See `Measurement`."""
        if points.all():
            return self
        stated, weight = (np.where(points, array, 0.0) for array in (self.stated, self.weight))
        return self._with(seen=self.seen & points, stated=stated, weight=weight)

    def without_sigmas(self) -> Self:
        """See `Measurement`."""
        return self._with(stated=np.zeros_like(self.stated))

    def point_counts(self) -> IntArray:
        """See `Measurement`."""
        return np.asarray(np.count_nonzero(self.seen, axis=-1), dtype=np.int64)

    def counts(self) -> dict[str, int]:
        """See `Measurement`."""
        stated, seen = int(np.count_nonzero(self.stated)), int(np.count_nonzero(self.seen))
        return {"stated": self.coordinates * stated, self.noise_field: self.coordinates * (seen - stated)}


@dataclass(frozen=True, eq=False)
class PointJacobians:
    """Residuals and Jacobians of each point of views.

    Attributes:
        residual: (n, p, d) predicted minus measured, in sigmas; zero for points that are not seen.
        jacobian: (n, p, d, 6 + k) derivative with respect to the view's tangent and to a free lens.
        seen: (n, p) whether the point was seen and is in front of the camera.
    """

    residual: Array
    jacobian: Array
    seen: BoolArray


def point_jacobians(
    measurement: SeenPoints, camera_from_target: SE3, camera: Camera | None, with_lens: bool
) -> PointJacobians:
    """Linearise each point of views at `camera_from_target`, (n,)."""
    residuals, by_pose, by_lens = measurement.tangent_rows(camera_from_target, camera, with_lens)
    seen = measurement.seen & (measurement.weight > 0) & np.isfinite(residuals).all(-1)
    weight = np.where(seen, measurement.weight, 0.0)[..., None]
    jacobian = by_pose if by_lens is None else np.concatenate([by_pose, by_lens], -1)
    return PointJacobians(np.nan_to_num(residuals) * weight, np.nan_to_num(jacobian) * weight[..., None], seen)
