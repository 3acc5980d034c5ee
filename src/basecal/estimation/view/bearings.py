"""Measurements of directions to a target's points, for initial guesses."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from basecal.estimation.view.measurement import Noise, ViewInformation
from basecal.estimation.view.moments import UPPER
from basecal.estimation.view.target_points import MeasuredPoints
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.array import to_front

_FIRST, _SECOND = np.array(UPPER).T
_IS_DIAGONAL = np.where(_FIRST == _SECOND, 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class BearingMeasurement(MeasuredPoints):
    """Directions to a target's points, for initial guesses.

    The residuals are also defined behind the camera, and do not depend on the lens, so that its fold has no effect.

    Attributes:
        bearings_in_camera: ([b,] n, p, 3) unit directions.
        weight: ([b,] n, p) 1 / sigma, 0 if the point is not seen [1/rad].
    """

    bearings_in_camera: Array
    weight: Array
    coordinates = 2
    axes = MappingProxyType({"bearings_in_camera": 3, "weight": 2})

    def linearise(self, camera_from_target: SE3, camera: Camera | None, with_lens: bool) -> ViewInformation:
        """See `Measurement`; the residual is the chord between seen and predicted unit vectors."""
        axes = to_front(self.camera_points(camera_from_target), -1)
        norm = np.maximum(np.sqrt(np.einsum("i...,i...->...", axes, axes)), 1e-12)
        unit = axes / norm
        seen = to_front(self.bearings_in_camera, -1)
        chord = unit - seen.reshape(3, *[1] * (unit.ndim - seen.ndim), *seen.shape[1:])
        chord *= self.weight
        # The derivative of a unit vector is a projection over the distance; a projection is idempotent.
        scale = self.weight / norm
        forces = chord - unit * np.einsum("i...,i...->...", unit, chord)
        forces *= scale
        squares = unit[_FIRST] * unit[_SECOND]
        np.subtract(_IS_DIAGONAL.reshape(len(UPPER), *[1] * norm.ndim), squares, out=squares)
        squares *= scale * scale
        cost = np.einsum("i...p,i...p->...", chord, chord)
        return self.information(cost, forces, squares, camera_from_target.rotation)

    def squares(self, camera_from_target: SE3, camera: Camera | None) -> dict[str, float]:
        """See `Measurement`; all weights are stated."""
        return {}

    def with_noise(self, noise: Noise) -> BearingMeasurement:
        """See `Measurement`; all weights are stated."""
        return self

    def counts(self) -> dict[str, int]:
        """See `Measurement`; a direction has two scalar residuals."""
        return {"stated": 2 * int(np.count_nonzero(self.weight))}
