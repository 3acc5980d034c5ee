"""What one view says of `camera_from_target`: cost, gradient and information.

With residuals r(delta) of `camera_from_target @ SE3.exp(delta)`, already divided by their sigmas, a view says
`cost = r'r`, `gradient = J'r` and `information = J'J`; a few columns more stand for the lens where it is free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from basecal.estimation.view.common_error import without_common_shift
from basecal.estimation.view.moments import UPPER, dot, gradient_and_information, monomials
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows
from basecal.geometry.se3 import right_jacobian_inverse

_CHUNK_POINTS = 7200


class ViewInformation(NamedTuple):
    """Per view: cost (n,), gradient (n, 6 + k), information (n, 6 + k, 6 + k)."""

    cost: Array
    gradient: Array
    information: Array


class Noise(NamedTuple):
    """Sigmas of what states none: a pixel coordinate [px], a measured pose [m, rad], a 3-D point [m]."""

    pixel_px: float = 1.0
    pose_m: float = 1e-3
    pose_rad: float = 1e-3
    point_m: float = 1e-3


class Measurement(Protocol):
    """All views of one target by one camera."""

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """What each view says at `camera_from_target`, (n,); with the lens's columns where `lens`."""
        ...

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """Sums of squared residuals over sigmas of what states no sigma, by field of `Noise`."""
        ...

    def with_noise(self, noise: Noise) -> Measurement:
        """The same with the sigmas that were not stated."""
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


def _information(residual: Array, jacobian: Array) -> ViewInformation:
    """From residuals (n, m) and their derivative by rows of unknowns, (n, k, m)."""
    gradient = (jacobian @ residual[..., None])[..., 0]
    return ViewInformation(
        np.einsum("ni,ni->n", residual, residual), gradient, jacobian @ np.swapaxes(jacobian, -1, -2)
    )


def _in_camera(camera_from_target: SE3, points_in_target: Array) -> Array:
    """Points in the camera, (n, p, 3), those of one coordinate side by side in memory."""
    by_axis = np.swapaxes(camera_from_target.rotation, 0, 1) @ points_in_target.T
    by_axis += camera_from_target.translation.T[:, :, None]
    return np.moveaxis(by_axis, 0, -1)


def _squares(residual: Sequence[Array]) -> Array:
    """Each view's sum of squares over arrays (n, p)."""
    total: Array = sum(np.einsum("np,np->n", r, r) for r in residual)
    return total


def _at_most_six(equations: IntArray) -> IntArray:
    return np.minimum(equations, 6).astype(np.int64)


def _width(by_lens: Array | None) -> int:
    return 0 if by_lens is None else int(by_lens.shape[-1])


def _by_pose(by_point: Array, rotation: Array, points: Array, more: int) -> Array:
    """Derivative of f(camera_from_target @ p), (n, 6 + more, d, p), the last `more` rows not filled.

    Args:
        by_point: df/dp, (n, p, d, 3).
        rotation: Of camera_from_target, (n, 3, 3).
        points: p in the target, (p, 3).
        more: Rows for other unknowns.
    """
    n, p, d, _ = by_point.shape
    out = np.empty((n, 6 + more, d, p))
    for i in range(d):
        out[:, :3, i] = np.swapaxes(rotation, -1, -2) @ np.swapaxes(by_point[:, :, i], -1, -2)
    x, y, z = points.T
    u, v, w = out[:, 0], out[:, 1], out[:, 2]
    out[:, 3] = y * w - z * v
    out[:, 4] = z * u - x * w
    out[:, 5] = x * v - y * u
    return out


@dataclass(frozen=True, eq=False)
class PixelMeasurement:
    """Pixels of a target's points.

    Attributes:
        points_in_target: (p, 3) [m].
        pixels: (n, p, 2) [px]; anything finite where not seen.
        seen: (n, p).
        stated: (n, p) 1 / sigma where a sigma was stated, else 0 [1/px].
        weight: (n, p) 1 / sigma in use, 0 where not seen [1/px].
        common_px: Sigma of an error that all points of a view have in common, per coordinate [px].
    """

    points_in_target: Array
    pixels: Array
    seen: BoolArray
    stated: Array
    weight: Array
    common_px: float = 0.0

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`; the cost is infinite where a seen point lies behind the camera.

        Many views go in chunks that stay in the processor's cache, which halves the time.
        """
        assert camera is not None
        n, p = self.weight.shape
        size = max(1, _CHUNK_POINTS // max(p, 1))
        if n <= 1.5 * size:
            return self._linearise(camera_from_target, camera, lens)
        chunks = [slice(at, at + size) for at in range(0, n, size)]
        parts = [self.take(c)._linearise(camera_from_target[c], camera, lens) for c in chunks]
        return ViewInformation(*(np.concatenate(field) for field in zip(*parts, strict=True)))

    def _linearise(self, camera_from_target: SE3, camera: Camera, lens: bool) -> ViewInformation:
        points = _in_camera(camera_from_target, self.points_in_target)
        pixels, by_point, by_lens = camera.project_with_derivatives(points, lens)
        residual = [(pixels[..., i] - self.pixels[..., i]) * self.weight for i in range(2)]
        cost = _squares(residual)
        if by_lens is not None or self.common_px or not np.all(np.isfinite(cost)):
            return self._with_jacobian(camera_from_target.rotation, pixels - self.pixels, by_point, by_lens)
        columns = [[by_point[..., i, j] * self.weight for i in range(2)] for j in range(3)]
        forces = (dot(column, residual) for column in columns)
        squares = (dot(columns[i], columns[j]) for i, j in UPPER)
        return ViewInformation(
            cost, *gradient_and_information(forces, squares, camera_from_target.rotation, self._monomials)
        )

    @cached_property
    def _monomials(self) -> Array:
        return monomials(self.points_in_target)

    def _with_jacobian(
        self, rotation: Array, residual: Array, by_point: Array, by_lens: Array | None
    ) -> ViewInformation:
        """The long way, for a lens that is free, a common shift, and points that have no pixel."""
        n, p = self.weight.shape
        lost = np.isnan(residual).any(-1)
        weight = np.where(lost, 0.0, self.weight)
        if lost.any():
            residual, by_point = np.nan_to_num(residual), np.nan_to_num(by_point)
        jacobian = _by_pose(by_point, rotation, self.points_in_target, _width(by_lens))
        if by_lens is not None:
            jacobian[:, 6:] = np.moveaxis(np.nan_to_num(by_lens) if lost.any() else by_lens, 1, -1).swapaxes(1, 2)
        jacobian *= weight[:, None, None]
        weighted = np.moveaxis(residual, -1, 1) * weight[:, None]
        view = _information(weighted.reshape(n, -1), jacobian.reshape(n, -1, 2 * p))
        if self.common_px:
            by_shift = np.einsum("nkip,np->nki", jacobian, weight)
            view = ViewInformation(*without_common_shift(view, weighted, weight, by_shift, self.common_px))
        return view._replace(cost=np.where((lost & self.seen).any(-1), np.inf, view.cost))

    def residual_px(self, camera_from_target: SE3, camera: Camera) -> Array:
        """Predicted minus seen pixels, (n, p, 2) [px]; NaN where not seen."""
        residual = camera.project(_in_camera(camera_from_target, self.points_in_target)) - self.pixels
        return np.where(self.seen[..., None], residual, np.nan)

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`."""
        assert camera is not None
        unstated = self.weight * (self.stated == 0)
        residual = np.nan_to_num(self.residual_px(camera_from_target, camera)) * unstated[..., None]
        return {"pixel_px": float(np.sum(residual**2))}

    def thinned(self, most: int) -> PixelMeasurement:
        """The same views of at most `most` of the points, evenly chosen."""
        rows = slice(None, None, -(-len(self.points_in_target) // most))
        of_points = {name: getattr(self, name)[:, rows] for name in ("pixels", "seen", "stated", "weight")}
        return replace(self, points_in_target=self.points_in_target[rows], **of_points)

    def with_noise(self, noise: Noise) -> PixelMeasurement:
        """See `Measurement`."""
        unstated = self.seen & (self.stated == 0)
        return replace(self, weight=self.stated + unstated / noise.pixel_px)

    def take(self, views: Rows) -> PixelMeasurement:
        """See `Measurement`."""
        return replace(
            self, pixels=self.pixels[views], seen=self.seen[views], stated=self.stated[views], weight=self.weight[views]
        )

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return _at_most_six(2 * np.count_nonzero(self.seen, axis=-1))

    def counts(self) -> dict[str, int]:
        """See `Measurement`."""
        stated = int(np.count_nonzero(self.stated))
        return {"stated": 2 * stated, "pixel_px": 2 * (int(np.count_nonzero(self.seen)) - stated)}


@dataclass(frozen=True, eq=False)
class BearingMeasurement:
    """Directions to a target's points, for starts: defined behind the camera too, and free of the lens's folds.

    Attributes:
        points_in_target: (p, 3) [m].
        bearings_in_camera: (n, p, 3) unit.
        weight: (n, p) 1 / sigma, 0 where not seen [1/rad].
    """

    points_in_target: Array
    bearings_in_camera: Array
    weight: Array

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`; the residual is the chord between seen and predicted unit vectors."""
        points = _in_camera(camera_from_target, self.points_in_target)
        axes = [points[..., i] for i in range(3)]
        norm = np.maximum(np.sqrt(dot(axes, axes)), 1e-12)
        unit = [axis / norm for axis in axes]
        chord = [(u - self.bearings_in_camera[..., i]) * self.weight for i, u in enumerate(unit)]
        # The derivative of a unit vector is the projection across it over the distance: its own square, but for scale.
        scale = self.weight / norm
        along = dot(unit, chord)
        forces = (scale * (c - u * along) for c, u in zip(chord, unit, strict=True))
        scale2 = scale * scale
        squares = (scale2 * (float(i == j) - unit[i] * unit[j]) for i, j in UPPER)
        return ViewInformation(
            _squares(chord), *gradient_and_information(forces, squares, camera_from_target.rotation, self._monomials)
        )

    @cached_property
    def _monomials(self) -> Array:
        return monomials(self.points_in_target)

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`; its weights are its own."""
        return {}

    def with_noise(self, noise: Noise) -> BearingMeasurement:
        """See `Measurement`; its weights are its own."""
        return self

    def take(self, views: Rows) -> BearingMeasurement:
        """See `Measurement`."""
        return replace(self, bearings_in_camera=self.bearings_in_camera[views], weight=self.weight[views])

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return _at_most_six(2 * np.count_nonzero(self.weight, axis=-1))

    def counts(self) -> dict[str, int]:
        """See `Measurement`: two free coordinates a direction."""
        return {"stated": 2 * int(np.count_nonzero(self.weight))}


@dataclass(frozen=True, eq=False)
class PoseMeasurement:
    """Poses of a target as another program measured them.

    Attributes:
        measured_camera_from_target: (n,).
        stated: (n, 6) 1 / sigma, or 0 where none was stated [1/m, 1/rad].
        weight: (n, 6) 1 / sigma in use [1/m, 1/rad].
    """

    measured_camera_from_target: SE3
    stated: Array
    weight: Array

    def _error(self, camera_from_target: SE3) -> Array:
        return (self.measured_camera_from_target.inverse() @ camera_from_target).log()

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`."""
        error = self._error(camera_from_target)
        jacobian = right_jacobian_inverse(error) * self.weight[..., None]
        return _information(error * self.weight, np.swapaxes(jacobian, -1, -2))

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`."""
        squared = (self._error(camera_from_target) * self.weight * (self.stated == 0)) ** 2
        return {"pose_m": float(squared[:, :3].sum()), "pose_rad": float(squared[:, 3:].sum())}

    def with_noise(self, noise: Noise) -> PoseMeasurement:
        """See `Measurement`."""
        default = 1 / np.array([noise.pose_m] * 3 + [noise.pose_rad] * 3)
        return replace(self, weight=np.where(self.stated == 0, default, self.stated))

    def take(self, views: Rows) -> PoseMeasurement:
        """See `Measurement`."""
        return PoseMeasurement(self.measured_camera_from_target[views], self.stated[views], self.weight[views])

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return np.full(len(self.weight), 6, dtype=np.int64)

    def counts(self) -> dict[str, int]:
        """See `Measurement`."""
        free = self.stated == 0
        t, r = int(np.count_nonzero(free[:, :3])), int(np.count_nonzero(free[:, 3:]))
        return {"stated": free.size - t - r, "pose_m": t, "pose_rad": r}


@dataclass(frozen=True, eq=False)
class PointMeasurement:
    """A target's points in 3-D.

    Attributes:
        points_in_target: (p, 3) [m].
        points_in_camera: (n, p, 3) [m]; anything finite where not seen.
        seen: (n, p) whether the point was seen.
        stated: (n, p) 1 / sigma, or 0 where none was stated [1/m].
        weight: (n, p) 1 / sigma in use, 0 where not seen [1/m].
    """

    points_in_target: Array
    points_in_camera: Array
    seen: BoolArray
    stated: Array
    weight: Array

    def _error(self, camera_from_target: SE3) -> Array:
        return _in_camera(camera_from_target, self.points_in_target) - self.points_in_camera

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`."""
        error = self._error(camera_from_target)
        residual = [error[..., i] * self.weight for i in range(3)]
        weight2 = self.weight * self.weight
        squares = (weight2 * float(i == j) for i, j in UPPER)
        forces = (r * self.weight for r in residual)
        return ViewInformation(
            _squares(residual), *gradient_and_information(forces, squares, camera_from_target.rotation, self._monomials)
        )

    @cached_property
    def _monomials(self) -> Array:
        return monomials(self.points_in_target)

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`."""
        unstated = self.weight * (self.stated == 0)
        return {"point_m": float(np.sum((self._error(camera_from_target) * unstated[..., None]) ** 2))}

    def with_noise(self, noise: Noise) -> PointMeasurement:
        """See `Measurement`."""
        return replace(self, weight=self.stated + (self.seen & (self.stated == 0)) / noise.point_m)

    def take(self, views: Rows) -> PointMeasurement:
        """See `Measurement`."""
        return replace(
            self,
            points_in_camera=self.points_in_camera[views],
            seen=self.seen[views],
            stated=self.stated[views],
            weight=self.weight[views],
        )

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return _at_most_six(3 * np.count_nonzero(self.seen, axis=-1))

    def counts(self) -> dict[str, int]:
        """See `Measurement`."""
        stated = int(np.count_nonzero(self.stated))
        return {"stated": 3 * stated, "point_m": 3 * (int(np.count_nonzero(self.seen)) - stated)}
