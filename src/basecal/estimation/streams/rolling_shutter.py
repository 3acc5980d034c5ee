"""Correction of rolling shutter: image rows are exposed in sequence while the target moves relative to the camera.

The time of a view is that of the mean row of its pixels. The motion between this time and the row of each pixel is
subtracted from the pixel. It follows from the velocities of the robots and from the known transforms.
Source: docs/mathematics.md (12.4).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from basecal.cell import WORLD, CandidateObservation, Cell, Observation, PixelObservation, Recording, Sample
from basecal.effects.row_time import row_shift
from basecal.geometry import SE3, Array, Camera

_NO_VELOCITY = np.zeros(6)


def line_time_name(camera: str) -> str:
    """Key of a camera's line time among the clock offsets; it differs from all device names."""
    return f"{camera} line"


def mean_row(sample: Sample) -> float:
    """Mean row of all pixels of a sample [px]; 0 if there are none."""
    rows = [o.pixels[:, 1] for o in sample.observations if isinstance(o, PixelObservation | CandidateObservation)]
    all_rows = np.concatenate([*rows, np.zeros(0)])
    return float(all_rows.mean()) if len(all_rows) else 0.0


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """State of a moving robot: `base_from_flange`, and its velocity in the flange's axes, (6,) [m/s, rad/s]."""

    base_from_flange: SE3
    velocity: Array


class _BodyMotion(NamedTuple):
    """Pose of a camera or target in the world, and its velocity in its own axes, (6,) [m/s, rad/s]."""

    world_from_body: SE3
    velocity: Array


@dataclass(frozen=True, eq=False)
class KnownGeometry:
    """Known transforms and lenses, from which pixels are corrected.

    Attributes:
        cell: The cell.
        transforms: Known transforms by name; views that need a missing transform are not corrected.
        lenses: Known lenses, by camera.
    """

    cell: Cell
    transforms: Mapping[str, SE3]
    lenses: Mapping[str, Camera]

    def camera_from_target(
        self, camera: str, target: str, robots: Mapping[str, RobotMotion]
    ) -> tuple[SE3, Array] | None:
        """Pose of a target in a camera, and its velocity in the target's axes, (6,) [m/s, rad/s]; None if unknown."""
        eye, hand = self._moving_body(camera, robots), self._moving_body(target, robots)
        if eye is None or hand is None:
            return None
        pose = eye.world_from_body.inverse() @ hand.world_from_body
        return pose, hand.velocity - pose.inverse().adjoint() @ eye.velocity

    def _moving_body(self, name: str, robots: Mapping[str, RobotMotion]) -> _BodyMotion | None:
        """Pose of a camera or target in the world, and its velocity in its own axes; None if unknown."""
        body = self.cell.cameras[name] if name in self.cell.cameras else self.cell.targets[name]
        carrier, mount = body.on, self.transforms.get(self.cell.mount_name(name))
        if mount is None or carrier == WORLD:
            return None if mount is None else _BodyMotion(mount, _NO_VELOCITY)
        base = SE3.identity() if carrier == self.cell.reference else self.transforms.get(self.cell.base_name(carrier))
        if base is None:
            return None
        return _BodyMotion(
            base @ robots[carrier].base_from_flange @ mount, mount.inverse().adjoint() @ robots[carrier].velocity
        )


def correct_rolling_shutter(
    recording: Recording,
    geometry: KnownGeometry,
    line_s: Mapping[str, float],
    robots: Mapping[str, Mapping[int, RobotMotion]],
) -> Recording:
    """Return a recording with pixels as if all rows had been exposed at the time of the mean row.

    Args:
        recording: Samples at the times of their mean rows.
        geometry: Known transforms and lenses.
        line_s: Line times by camera [s].
        robots: States of moving robots, by name, then by sample.
    """
    rolling = {camera for camera, line in line_s.items() if line and camera in geometry.lenses}
    samples = []
    for sample in recording.samples:
        motions = {name: by_sample[sample.sample] for name, by_sample in robots.items() if sample.sample in by_sample}
        middle_row = mean_row(sample)
        corrected = tuple(
            _correct_rows(o, geometry, line_s[o.camera], middle_row, motions) if o.camera in rolling else o
            for o in sample.observations
        )
        samples.append(replace(sample, observations=corrected))
    return replace(recording, samples=tuple(samples))


def _correct_rows(
    observation: Observation,
    geometry: KnownGeometry,
    line_s: float,
    middle_row: float,
    robots: Mapping[str, RobotMotion],
) -> Observation:
    target = geometry.cell.targets[observation.target].target
    if not isinstance(observation, PixelObservation | CandidateObservation) or target is None:
        return observation
    pose_and_velocity = geometry.camera_from_target(observation.camera, observation.target, robots)
    if pose_and_velocity is None:
        return observation
    ids = (
        observation.ids
        if isinstance(observation, PixelObservation)
        else np.repeat(target.ids[:1], len(observation.pixels))
    )
    points, (pose, velocity) = target.points[target.rows(ids)], pose_and_velocity
    delay_s = (observation.pixels[:, 1] - middle_row) * line_s
    shift_px = row_shift(geometry.lenses[observation.camera], pose, velocity, points, delay_s)
    return replace(observation, pixels=observation.pixels - shift_px)
