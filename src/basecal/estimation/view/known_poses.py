"""Poses of views that are requested again and again, as recordings are paired in other ways: each is found once."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.view_pose import ViewPoses, view_poses
from basecal.geometry import Array, BoolArray
from basecal.numerics.batch import concatenate, take


@dataclass(frozen=True, eq=False)
class KnownPoses:
    """`view_poses` that remembers what it found of each view, by all that its pose depends on.

    Attributes:
        known: What was found of views, a batch of one each.
    """

    known: dict[bytes, ViewPoses] = field(default_factory=dict)

    def __call__(
        self, points_in_target: Array, bearings_in_camera: Array, is_visible: BoolArray, measurement: BearingMeasurement
    ) -> ViewPoses:
        """See `view_poses`."""
        target = points_in_target.tobytes()
        of_views = zip(bearings_in_camera, is_visible, measurement.weight, strict=True)
        keys = [target + b.tobytes() + s.tobytes() + w.tobytes() for b, s, w in of_views]
        rows = np.array([row for row, key in enumerate(keys) if key not in self.known], dtype=np.int64)
        if len(rows):
            found = view_poses(points_in_target, bearings_in_camera[rows], is_visible[rows], measurement.take(rows))
            for k, row in enumerate(rows):
                self.known[keys[row]] = take(found, np.array([k]))
        return concatenate([self.known[key] for key in keys])
