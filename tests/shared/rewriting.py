"""Recordings with a mix-up, sample by sample, which readings must undo."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from basecal.cell import (
    CandidateObservation,
    Cell,
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Recording,
    RobotState,
    Sample,
)
from basecal.geometry import SE3, Array

PoseMap = Callable[[SE3], SE3]


def inverted(poses: SE3) -> SE3:
    """The inverses, (n,)."""
    return poses.inverse()


def scaled(factor: float) -> PoseMap:
    """Translations times `factor`."""
    return lambda poses: SE3(poses.rotation, poses.translation * factor)


def reordered(order: tuple[int, int, int, int]) -> PoseMap:
    """Rotations with the components of their quaternions in another order; a sign does not matter."""
    return lambda poses: SE3.from_quaternion(poses.quaternion[..., list(order)], poses.translation)


def degrees(poses: SE3) -> SE3:
    """Rotation vectors converted from radians into degrees: those that were read in the wrong unit."""
    return SE3.from_rotvec(np.degrees(poses.rotvec), poses.translation)


def degrees_of_rpy(poses: SE3) -> SE3:
    """The same for roll, pitch and yaw about fixed axes."""
    return SE3.from_rpy(np.degrees(poses.rpy), poses.translation)


def through_the_camera(poses: SE3) -> SE3:
    """The other pose from which a plane's points are on the same rays: behind the camera if this one is in front."""
    return SE3(poses.rotation * np.array([-1.0, -1.0, 1.0]), -poses.translation)


def with_robots(recording: Recording, maps: Mapping[str, PoseMap]) -> Recording:
    """The recording with the poses of robots mapped; joints stay unchanged."""
    samples = list(recording.samples)
    for robot, pose_map in maps.items():
        having = [(i, s.robots[robot].base_from_flange) for i, s in enumerate(samples) if robot in s.robots]
        poses = {i: pose for i, pose in having if pose is not None}
        mapped = pose_map(SE3.stack(list(poses.values())))
        for k, i in enumerate(poses):
            samples[i] = replace(samples[i], robots={**samples[i].robots, robot: RobotState(mapped[k])})
    return replace(recording, samples=tuple(samples))


def with_joints(recording: Recording, robot: str, factor: float) -> Recording:
    """The recording with a robot's joints times `factor`."""

    def scale_joints(state: RobotState) -> RobotState:
        """The state with its joints, if any, times the factor."""
        return state if state.joints_rad is None else RobotState(joints_rad=state.joints_rad * factor)

    samples = (
        replace(s, robots={name: scale_joints(state) if name == robot else state for name, state in s.robots.items()})
        for s in recording.samples
    )
    return replace(recording, samples=tuple(samples))


def exchanged(recording: Recording, first: str, second: str) -> Recording:
    """The recording with the states of two robots exchanged."""
    name = {first: second, second: first}
    samples = (
        replace(s, robots={name.get(robot, robot): state for robot, state in s.robots.items()})
        for s in recording.samples
    )
    return replace(recording, samples=tuple(samples))


def with_targets(recording: Recording, pose_map: PoseMap) -> Recording:
    """The recording with every observed pose mapped."""
    poses = [
        (i, j, o)
        for i, s in enumerate(recording.samples)
        for j, o in enumerate(s.observations)
        if isinstance(o, PoseObservation)
    ]
    mapped = pose_map(SE3.stack([o.camera_from_target for _, _, o in poses]))
    samples: list[list[Observation]] = [list(s.observations) for s in recording.samples]
    for k, (i, j, observation) in enumerate(poses):
        samples[i][j] = replace(observation, camera_from_target=mapped[k])
    return _with_observations(recording, samples)


def with_points(recording: Recording, factor: float) -> Recording:
    """The recording with observed 3-D points times `factor`; stated sigmas stay unchanged."""
    samples: list[list[Observation]] = [
        [
            replace(o, points_in_camera=o.points_in_camera * factor) if isinstance(o, PointObservation) else o
            for o in s.observations
        ]
        for s in recording.samples
    ]
    return _with_observations(recording, samples)


def with_pixels(recording: Recording, pixel_map: Callable[[Array], Array]) -> Recording:
    """The recording with the pixels of every observation, (n, 2), mapped."""
    samples: list[list[Observation]] = [
        [
            replace(o, pixels=pixel_map(o.pixels)) if isinstance(o, PixelObservation | CandidateObservation) else o
            for o in observations
        ]
        for observations in (s.observations for s in recording.samples)
    ]
    return _with_observations(recording, samples)


def _with_observations(recording: Recording, observations: list[list[Observation]]) -> Recording:
    samples = (replace(s, observations=tuple(o)) for s, o in zip(recording.samples, observations, strict=True))
    return replace(recording, samples=tuple(samples))


def shifted(recording: Recording, stream: str | None, by: int, start: int = 0) -> Recording:
    """The recording with one stream shifted: position i gets the stream of position i - `by`.

    Args:
        recording: Samples in the order of time.
        stream: Name of a robot, or None for the observations.
        by: Number of samples.
        start: First shifted position; earlier samples stay unchanged.

    Returns:
        The recording, without samples that have no partner.
    """
    old = recording.samples
    out = []
    for i, sample in enumerate(old):
        source = i if i < start else i - by
        if source >= len(old) or (i >= start and source < start):
            continue
        paired = _pair(sample, old[source], stream)
        if paired is not None:
            out.append(paired)
    return replace(recording, samples=tuple(out))


def turned_round(recording: Recording, stream: str | None) -> Recording:
    """The recording with one stream in reverse order, without samples that have no partner."""
    old = recording.samples
    paired = (_pair(sample, source, stream) for sample, source in zip(old, reversed(old), strict=True))
    return replace(recording, samples=tuple(sample for sample in paired if sample is not None))


def _pair(sample: Sample, source: Sample, stream: str | None) -> Sample | None:
    robots, observations = sample.robots, source.observations
    if stream is not None:
        if stream not in source.robots:
            return None
        robots, observations = {**robots, stream: source.robots[stream]}, sample.observations
    # `dataclasses.replace` takes four times as long, which of ten thousand samples a dozen times over is a second.
    return Sample(sample.sample, sample.stamp_s, robots, observations, sample.images, sample.background)


def resized(cell: Cell, factors: Mapping[str, float]) -> Cell:
    """The cell with the points of targets times a factor, by the name of the target."""
    targets = dict(cell.targets)
    for name, factor in factors.items():
        shape = targets[name].target
        assert shape is not None
        targets[name] = replace(targets[name], target=replace(shape, points=shape.points * factor))
    return replace(cell, targets=targets)
