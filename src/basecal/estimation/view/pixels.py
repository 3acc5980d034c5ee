"""Measurements of pixels of a target's points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Self

import numpy as np

from basecal.estimation.view.common_error import without_common_shift
from basecal.estimation.view.measurement import (
    Noise,
    ViewInformation,
    sums_of_squares,
)
from basecal.estimation.view.moments import UPPER, dot
from basecal.estimation.view.target_points import SeenPoints, require_camera, spread_rows
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.geometry.array import to_back, to_front
from basecal.geometry.lens import Projection

# Points per chunk, so that the arrays stay in the cache: smaller chunks cost overhead of NumPy, larger ones memory
# access. `benchmarks.solve` measures the time.
_CHUNK_POINTS = 28800
_CHUNK_LENS_POINTS = 12000  # points per chunk with a free lens, which has more arrays


@dataclass(frozen=True, eq=False)
class PixelMeasurement(SeenPoints):
    """Pixels of a target's points.

    Attributes:
        pixels: ([b,] n, p, 2) [px]; any finite values for points that are not seen.
        seen: (n, p) whether the point was seen.
        stated: (n, p) 1 / sigma if a sigma was stated, else 0 [1/px].
        weight: (n, p) 1 / sigma in use, 0 for points that are not seen [1/px].
        common_px: Sigma of an error that all points of a view share, per coordinate [px].
        relative: (n, p) `Noise.pixel_px` / sigma of points without stated sigma; None for 1 everywhere.
    """

    pixels: Array
    seen: BoolArray
    stated: Array
    weight: Array
    common_px: float = 0.0
    relative: Array | None = None
    coordinates = 2
    noise_field = "pixel_px"
    axes = MappingProxyType({"pixels": 3, "seen": 2, "stated": 2, "weight": 2, "relative": 2})

    def residuals(self, camera_from_target: SE3, camera: Camera | None) -> Array:
        """See `SeenPoints`."""
        return require_camera(camera).project(self.camera_points(camera_from_target)) - self.pixels

    def with_derivatives(
        self, points_in_camera: Array, camera: Camera | None, with_lens: bool
    ) -> tuple[Array, Array, Array | None]:
        """See `SeenPoints`."""
        pixels, by_point, by_lens = require_camera(camera).project_with_derivatives(points_in_camera, with_lens)
        return pixels - self.pixels, by_point, by_lens

    def linearise(self, camera_from_target: SE3, camera: Camera | None, with_lens: bool) -> ViewInformation:
        """See `Measurement`; the cost of a view is infinite if a seen point is behind the camera.

        Many views are processed in chunks that fit the processor's cache, which halves the time.
        """
        camera = require_camera(camera)
        *batch, count = camera_from_target.shape
        if batch == [1]:
            single_camera = camera if camera.parameters.ndim == 1 else camera[0]
            single = self.take_batch(0).linearise(camera_from_target[0], single_camera, with_lens)
            return ViewInformation(*(field[None] for field in single))
        points = len(self.points_in_target) * (count if batch else 1)
        size = max(1, (_CHUNK_LENS_POINTS if with_lens else _CHUNK_POINTS) // max(points, 1))
        if camera_from_target.shape[0] <= 1.5 * size:
            return self._linearise(camera_from_target, camera, with_lens)
        chunks = [slice(start, start + size) for start in range(0, camera_from_target.shape[0], size)]
        if batch:
            lenses = [camera[c] if camera.parameters.ndim > 1 else camera for c in chunks]
            measurements = [self.take_batch(c) for c in chunks]
        else:
            lenses, measurements = [camera] * len(chunks), [self.take(c) for c in chunks]
        parts = [
            part._linearise(camera_from_target[c], lens, with_lens)
            for part, c, lens in zip(measurements, chunks, lenses, strict=True)
        ]
        return ViewInformation(*(np.concatenate(field) for field in zip(*parts, strict=True)))

    def _linearise(self, camera_from_target: SE3, camera: Camera, with_lens: bool) -> ViewInformation:
        rotated_points = self.rotate_points(camera_from_target)
        pixels, image = camera.image(self.translate(camera_from_target, rotated_points), with_lens)
        if with_lens or self.common_px:
            return self._with_jacobian(camera_from_target.rotation, rotated_points, pixels, image)
        by_point = image.by_points
        residual = [(pixels[..., i] - self.pixels[..., i]) * self.weight for i in range(2)]
        cost = sums_of_squares(residual)
        if not np.all(np.isfinite(cost)):
            return self._with_jacobian(camera_from_target.rotation, rotated_points, pixels, image)
        columns = [[by_point[..., i, j] * self.weight for i in range(2)] for j in range(3)]
        forces = (dot(column, residual) for column in columns)
        squares = (dot(columns[i], columns[j]) for i, j in UPPER)
        return self.information(cost, forces, squares, camera_from_target.rotation)

    def linearise_shape(
        self, camera_from_target: SE3, camera: Camera | None, with_lens: bool, by_shape: Array
    ) -> ViewInformation:
        """Same as `linearise`, with additional columns for the target's shape, after those of the lens.

        Args:
            camera_from_target: (..., n) poses.
            camera: The lens.
            with_lens: Whether to include columns of the lens.
            by_shape: (p, 3, k) derivative of points with respect to k shape parameters [m].
        """
        rotated_points = self.rotate_points(camera_from_target)
        pixels, image = require_camera(camera).image(self.translate(camera_from_target, rotated_points), with_lens)
        by_more = image.by_points @ (camera_from_target.rotation[..., None, :, :] @ by_shape)
        return self._with_jacobian(camera_from_target.rotation, rotated_points, pixels, image, by_more)

    def _with_jacobian(
        self, rotation: Array, rotated_points: Array, pixels: Array, image: Projection, by_more: Array | None = None
    ) -> ViewInformation:
        """Information of views from Jacobians: for a free lens, a shared shift, and points without a pixel."""
        rows, is_lost = self._weighted_rows(pixels, image, by_more, rotated_points), np.zeros(1, dtype=bool)
        # Usually every point has a pixel, for which the sum is a fast test.
        if not np.isfinite(pixels.sum()):
            is_lost = np.asarray(np.isnan(pixels).any(-1))
            rows[..., is_lost] = 0.0
            np.nan_to_num(rows, copy=False)
        view = _information_of_rows(rows, rotation)
        if self.common_px:
            by_shift = _rotate_columns(
                to_back(np.einsum("ki...p,...p->ki...", rows[1:], self.weight * ~is_lost), 2), rotation
            )
            residual = np.moveaxis(rows[0], 0, -2)
            view = ViewInformation(
                *without_common_shift(view, residual, self.weight * ~is_lost, by_shift, self.common_px)
            )
        if not is_lost.any():
            return view
        return view._replace(cost=np.where((is_lost & self.seen).any(-1), np.inf, view.cost))

    def _weighted_rows(self, pixels: Array, image: Projection, by_more: Array | None, rotated_points: Array) -> Array:
        """Residuals in sigmas, and their derivatives by pose, lens and more, (1 + 6 + k, 2, ..., n, p).

        Derivatives with respect to the pose are those of a translation and a rotation about the target's origin, in the
        axes of the camera.

        Args:
            pixels: Predicted pixels, (..., n, p, 2) [px].
            image: Projection of the points; if it has derivatives of the terms, all lens parameters have columns.
            by_more: Derivative with respect to further unknowns, (..., n, p, 2, k), or None.
            rotated_points: Points relative to the target's origin in the camera's axes, (3, ..., n, p) [m].
        """
        parts = [_planes(derivative) for derivative in (image.by_terms, by_more) if derivative is not None]
        column = 7 if image.by_terms is None else 11
        out = np.empty((column + sum(map(len, parts)), 2, *pixels.shape[:-1]))
        for i in range(2):
            np.subtract(pixels[..., i], self.pixels[..., i], out=out[0, i])
        out[0] *= self.weight
        np.multiply(_planes(image.by_points), self.weight, out=out[1:4])
        product = np.empty(out.shape[1:])
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            np.multiply(rotated_points[j], out[1 + k], out=out[4 + i])
            np.multiply(rotated_points[k], out[1 + j], out=product)
            out[4 + i] -= product
        if image.by_terms is not None:
            out[7:column] = 0.0
            for i, derivative in enumerate((image.u, image.v)):
                np.multiply(derivative, self.weight, out=out[7 + i, i])
                out[9 + i, i] = self.weight
        for part in parts:
            np.multiply(part, self.weight, out=out[column : column + len(part)])
            column += len(part)
        return out

    def residual_px(self, camera_from_target: SE3, camera: Camera) -> Array:
        """Predicted minus measured pixels, (n, p, 2) [px]; NaN for points that are not seen."""
        return np.where(self.seen[..., None], self.residuals(camera_from_target, camera), np.nan)

    def thin(self, max_count: int, is_paired: bool = False) -> PixelMeasurement:
        """Return a copy with at most `max_count` of the points, spread over the target.

        Args:
            max_count: Most points to keep.
            is_paired: Whether to keep with each point its counterpart in the reverse order of points.
        """
        count = len(self.points_in_target)
        if is_paired:
            half = spread_rows(self.points_in_target[: (count + 1) // 2], (max_count + 1) // 2)
            # A middle point is its own counterpart.
            rows = np.concatenate([half, count - 1 - half[half < count // 2][::-1]])
        else:
            rows = spread_rows(self.points_in_target, max_count)
        return replace(self.take_points(rows), points_in_target=self.points_in_target[rows])

    def with_noise(self, noise: Noise) -> Self:
        """See `Measurement`."""
        unstated = self.seen & (self.stated == 0)
        relative = 1.0 if self.relative is None else self.relative
        return replace(self, weight=self.stated + unstated * relative / noise.pixel_px)

    def noisier(self, factor: float) -> PixelMeasurement:
        """See `Measurement`."""
        return replace(self, weight=self.weight / factor, common_px=self.common_px * factor)

    def without_sigmas(self) -> Self:
        """See `Measurement`."""
        # 1 / sigma of points relative to the median point; 1 if none was stated.
        stated = self.stated > 0
        middle = float(np.median(self.stated[stated])) if stated.any() else 1.0
        shares = np.where(stated, self.stated / middle, 1.0)
        return replace(self, relative=shares, stated=np.zeros_like(self.stated))


def _planes(derivative: Array) -> Array:
    """Transpose (..., 2, k) to (k, 2, ...)."""
    return to_front(to_front(derivative, -2), -1)


def _information_of_rows(rows: Array, rotation: Array) -> ViewInformation:
    """Information of views from rows (1 + k, 2, ..., n, p): residuals, then derivatives in the camera's axes."""
    u, v = (to_back(rows[:, i]) for i in range(2))  # (..., n, p, 1 + k)
    # For a product of a matrix with itself, BLAS computes one half only, which is slower for such small matrices.
    product = u[..., 1:].mT @ u
    product += v[..., 1:].mT @ v
    cost = np.einsum("i...p,i...p->...", rows[0], rows[0])
    by_target = _rotate_columns(product, rotation)
    information = _rotate_columns(by_target[..., 1:].mT, rotation)
    return ViewInformation(cost, by_target[..., 0], information)


def _rotate_columns(columns: Array, rotation: Array) -> Array:
    """Rotate the six pose rows of (..., 6 + k, m) from the camera's axes to the target's axes, in place."""
    pose = columns[..., :6, :]
    *shape, _, m = pose.shape
    rotated = rotation.mT[..., None, :, :] @ pose.reshape(*shape, 2, 3, m)
    pose[...] = rotated.reshape(pose.shape)
    return columns
