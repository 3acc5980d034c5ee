"""Pixels of a target's points: what views of them say."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.view.common_error import without_common_shift
from basecal.estimation.view.measurement import (
    Noise,
    ViewInformation,
    at_most_six,
    of_batch_rows,
    sums_of_squares,
)
from basecal.estimation.view.moments import UPPER, dot
from basecal.estimation.view.target_points import TargetPoints, needed, spread_out
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows

# Points whose arrays stay near the core: fewer cost NumPy's overhead, more the memory's. A free lens has more of them.
_CHUNK_POINTS = 28800
_CHUNK_LENS_POINTS = 12000


@dataclass(frozen=True, eq=False)
class PixelMeasurement(TargetPoints):
    """Pixels of a target's points.

    Attributes:
        pixels: ([b,] n, p, 2) [px]; anything finite where not seen.
        seen: (n, p).
        stated: (n, p) 1 / sigma where a sigma was stated, else 0 [1/px].
        weight: (n, p) 1 / sigma in use, 0 where not seen [1/px].
        common_px: Sigma of an error that all points of a view have in common, per coordinate [px].
        relative: (n, p) 1 / sigma of points without a stated one over that of `Noise.pixel_px`; None for 1 everywhere.
    """

    pixels: Array
    seen: BoolArray
    stated: Array
    weight: Array
    common_px: float = 0.0
    relative: Array | None = None

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`; the cost is infinite where a seen point lies behind the camera.

        Many views go in chunks that stay in the processor's cache, which halves the time.
        """
        camera = needed(camera)
        *batch, count = camera_from_target.shape
        points = max(len(self.points_in_target), 1) * (count if batch else 1)
        size = max(1, (_CHUNK_LENS_POINTS if lens else _CHUNK_POINTS) // max(points, 1))
        if camera_from_target.shape[0] <= 1.5 * size:
            return self._linearise(camera_from_target, camera, lens)
        chunks = [slice(at, at + size) for at in range(0, camera_from_target.shape[0], size)]
        if batch:
            lenses = [camera[c] if camera.parameters.ndim > 1 else camera for c in chunks]
            of_chunks = [self.of_batch(c) for c in chunks]
        else:
            lenses, of_chunks = [camera] * len(chunks), [self.take(c) for c in chunks]
        parts = [
            of._linearise(camera_from_target[c], one, lens)
            for of, c, one in zip(of_chunks, chunks, lenses, strict=True)
        ]
        return ViewInformation(*(np.concatenate(field) for field in zip(*parts, strict=True)))

    def _linearise(self, camera_from_target: SE3, camera: Camera, lens: bool) -> ViewInformation:
        points = self.in_camera(camera_from_target)
        pixels, by_point, by_lens = camera.project_with_derivatives(points, lens)
        if by_lens is not None or self.common_px:
            return self._with_jacobian(camera_from_target.rotation, pixels - self.pixels, by_point, by_lens)
        residual = [(pixels[..., i] - self.pixels[..., i]) * self.weight for i in range(2)]
        cost = sums_of_squares(residual)
        if not np.all(np.isfinite(cost)):
            return self._with_jacobian(camera_from_target.rotation, pixels - self.pixels, by_point, None)
        columns = [[by_point[..., i, j] * self.weight for i in range(2)] for j in range(3)]
        forces = (dot(column, residual) for column in columns)
        squares = (dot(columns[i], columns[j]) for i, j in UPPER)
        return self.information(cost, forces, squares, camera_from_target.rotation)

    def linearise_shape(
        self, camera_from_target: SE3, camera: Camera | None, lens: bool, by_shape: Array
    ) -> ViewInformation:
        """As `linearise`, with further columns, after those of the lens, for what moves points in the target.

        Args:
            camera_from_target: (..., n).
            camera: The lens.
            lens: Whether to give its columns.
            by_shape: (p, 3, k) how points move by each of them [m].
        """
        points = self.in_camera(camera_from_target)
        pixels, by_point, by_lens = needed(camera).project_with_derivatives(points, lens)
        by_more = by_point @ (camera_from_target.rotation[..., None, :, :] @ by_shape)
        if by_lens is not None:
            by_more = np.concatenate([by_lens, by_more], -1)
        return self._with_jacobian(camera_from_target.rotation, pixels - self.pixels, by_point, by_more)

    def _with_jacobian(
        self, rotation: Array, residual: Array, by_point: Array, by_lens: Array | None
    ) -> ViewInformation:
        """The long way, for a lens that is free, a common shift, and points that have no pixel."""
        weight, lost = self.weight, np.zeros(1, dtype=bool)
        # Most often every point has a pixel, which the sum tells at once.
        if not np.isfinite(residual.sum()):
            lost = np.asarray(np.isnan(residual).any(-1))
            residual, by_point = np.nan_to_num(residual), np.nan_to_num(by_point)
            by_lens = None if by_lens is None else np.nan_to_num(by_lens)
            weight = np.where(lost, 0.0, weight)
        rows = _weighted_rows(residual, by_point, by_lens, rotation, self.points_in_target, weight)
        view = _information_of_rows(rows)
        if self.common_px:
            by_shift = np.einsum("k...ip,...p->...ki", rows[1:], weight)
            off = np.asarray(rows[0])
            view = ViewInformation(*without_common_shift(view, off, weight, by_shift, self.common_px))
        if not lost.any():
            return view
        return view._replace(cost=np.where((lost & self.seen).any(-1), np.inf, view.cost))

    def residual_px(self, camera_from_target: SE3, camera: Camera) -> Array:
        """Predicted minus seen pixels, (n, p, 2) [px]; NaN where not seen."""
        residual = camera.project(self.in_camera(camera_from_target)) - self.pixels
        return np.where(self.seen[..., None], residual, np.nan)

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`."""
        unstated = self.weight * (self.stated == 0)
        residual = np.nan_to_num(self.residual_px(camera_from_target, needed(camera))) * unstated[..., None]
        return {"pixel_px": float(np.sum(residual**2))}

    def thinned(self, most: int, paired: bool = False) -> PixelMeasurement:
        """The same views of at most `most` of the points, spread over the target.

        Args:
            most: How many.
            paired: Whether with each point the one is kept that takes its place where the target is read from its
                other end.
        """
        count = len(self.points_in_target)
        if paired:
            half = spread_out(self.points_in_target[: (count + 1) // 2], (most + 1) // 2)
            rows = np.unique(np.concatenate([half, count - 1 - half]))
        else:
            rows = spread_out(self.points_in_target, most)
        of_points = {name: getattr(self, name)[:, rows] for name in ("pixels", "seen", "stated", "weight")}
        relative = None if self.relative is None else self.relative[:, rows]
        return replace(self, points_in_target=self.points_in_target[rows], relative=relative, **of_points)

    def with_noise(self, noise: Noise) -> PixelMeasurement:
        """See `Measurement`."""
        unstated = self.seen & (self.stated == 0)
        relative = 1.0 if self.relative is None else self.relative
        return replace(self, weight=self.stated + unstated * relative / noise.pixel_px)

    def noisier(self, factor: float) -> PixelMeasurement:
        """See `Measurement`."""
        return replace(self, weight=self.weight / factor, common_px=self.common_px * factor)

    def of_batch(self, rows: Rows) -> PixelMeasurement:
        """See `Measurement`."""
        seen = self.seen[rows] if self.seen.ndim > 2 else self.seen
        pixels, stated = of_batch_rows(self.pixels, rows, 3), of_batch_rows(self.stated, rows, 2)
        weight = of_batch_rows(self.weight, rows, 2)
        relative = None if self.relative is None else of_batch_rows(self.relative, rows, 2)
        return replace(self, pixels=pixels, seen=seen, stated=stated, weight=weight, relative=relative)

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return at_most_six(2 * np.count_nonzero(self.seen, axis=-1))

    def counts(self) -> dict[str, int]:
        """See `Measurement`."""
        stated = int(np.count_nonzero(self.stated))
        return {"stated": 2 * stated, "pixel_px": 2 * (int(np.count_nonzero(self.seen)) - stated)}


def _weighted_rows(
    residual: Array, by_point: Array, by_lens: Array | None, rotation: Array, points: Array, weight: Array
) -> Array:
    """Residuals and their derivatives by pose and lens, over sigmas, (1 + 6 + k, ..., n, 2, p).

    Args:
        residual: (..., n, p, 2) [px].
        by_point: Derivative to the points in the camera, (..., n, p, 2, 3).
        by_lens: Derivative to further unknowns, (..., n, p, 2, k), or None.
        rotation: Of camera_from_target, (..., n, 3, 3).
        points: In the target, (p, 3).
        weight: (..., n, p).
    """
    more = 0 if by_lens is None else int(by_lens.shape[-1])
    out = np.empty((7 + more, *residual.shape[:-2], 2, residual.shape[-2]))
    x, y, z = points.T
    target_from_camera = np.swapaxes(rotation, -1, -2)
    for i in range(2):
        np.multiply(residual[..., i], weight, out=out[0, ..., i, :])
        shift = target_from_camera @ np.swapaxes(by_point[..., i, :] * weight[..., None], -1, -2)
        u, v, w = (shift[..., j, :] for j in range(3))
        out[1:4, ..., i, :] = np.moveaxis(shift, -2, 0)
        np.subtract(y * w, z * v, out=out[4, ..., i, :])
        np.subtract(z * u, x * w, out=out[5, ..., i, :])
        np.subtract(x * v, y * u, out=out[6, ..., i, :])
        if by_lens is not None:
            np.multiply(np.moveaxis(by_lens[..., i, :], -1, 0), weight, out=out[7:, ..., i, :])
    return out


def _information_of_rows(rows: Array) -> ViewInformation:
    """What views say whose residuals, and their derivatives, are rows (1 + k, ..., n, 2, p)."""
    flat = np.moveaxis(rows.reshape(*rows.shape[:-2], -1), 0, -2)
    # Of a product of something with itself BLAS makes half, which takes longer where it is as small as this.
    product = flat[..., 1:, :] @ np.swapaxes(flat, -1, -2)
    cost = np.einsum("...i,...i->...", flat[..., 0, :], flat[..., 0, :])
    return ViewInformation(cost, product[..., 0], product[..., 1:])
