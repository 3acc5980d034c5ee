"""Directions to a target's points: what views of them say, for starts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.view.measurement import Noise, ViewInformation, at_most_six, of_batch_rows, sums_of_squares
from basecal.estimation.view.moments import UPPER, dot
from basecal.estimation.view.target_points import TargetPoints
from basecal.geometry import SE3, Array, Camera, IntArray, Rows


@dataclass(frozen=True, eq=False)
class BearingMeasurement(TargetPoints):
    """Directions to a target's points, for starts: defined behind the camera too, and free of the lens's folds.

    Attributes:
        bearings_in_camera: ([b,] n, p, 3) unit.
        weight: ([b,] n, p) 1 / sigma, 0 where not seen [1/rad].
    """

    bearings_in_camera: Array
    weight: Array

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`; the residual is the chord between seen and predicted unit vectors."""
        points = self.in_camera(camera_from_target)
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
        return self.information(sums_of_squares(chord), forces, squares, camera_from_target.rotation)

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`; its weights are its own."""
        return {}

    def with_noise(self, noise: Noise) -> BearingMeasurement:
        """See `Measurement`; its weights are its own."""
        return self

    def noisier(self, factor: float) -> BearingMeasurement:
        """See `Measurement`."""
        return replace(self, weight=self.weight / factor)

    def of_batch(self, rows: Rows) -> BearingMeasurement:
        """See `Measurement`."""
        bearings, weight = of_batch_rows(self.bearings_in_camera, rows, 3), of_batch_rows(self.weight, rows, 2)
        return replace(self, bearings_in_camera=bearings, weight=weight)

    def equations(self) -> IntArray:
        """See `Measurement`."""
        return at_most_six(2 * np.count_nonzero(self.weight, axis=-1))

    def counts(self) -> dict[str, int]:
        """See `Measurement`: two free coordinates a direction."""
        return {"stated": 2 * int(np.count_nonzero(self.weight))}
