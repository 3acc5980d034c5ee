"""A cell and its recording as arrays, and transformations to other interpretations of them.

The packed arrays are transformed: poses, points and pixels are mapped, and robot states are paired with other views.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from basecal.accuracy.phrases.target_length import scale_lengths
from basecal.cell import WORLD, Cell, Recording, RobotState, Unknown
from basecal.estimation.problem.build import canonical_order, recorded_states, restate
from basecal.estimation.problem.correspondence import half_turn
from basecal.estimation.problem.problem import Problem, Stops
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.view.measurement import Measurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, BoolArray, IntArray
from basecal.numerics.batch import concatenate

PoseMap = Callable[[SE3], SE3]
M = TypeVar("M", bound=Measurement)


@dataclass(frozen=True, eq=False)
class Track:
    """Recorded states of one robot, by sample in the order of time.

    Attributes:
        seen: Whether a sample has a state of the robot, (m,).
        pose: base_from_flange, (m,); a sample without a state has the pose of another sample.
        joints: Joint positions, (m, k) [rad]; None if poses were recorded.
        stop_number: Number of the stop, (m,); -1 for a sample without a state.
        has_only_poses: Whether every state was recorded as a pose.
    """

    seen: BoolArray
    pose: SE3
    joints: Array | None
    stop_number: IntArray
    has_only_poses: bool

    def take(self, rows: IntArray) -> Track:
        """States of the samples at these rows, (n,); row -1 gives a sample without a state."""
        joints = None if self.joints is None else self.joints[rows]
        return replace(
            self,
            seen=(rows >= 0) & self.seen[rows],
            pose=self.pose[rows],
            joints=joints,
            stop_number=np.where(rows >= 0, self.stop_number[rows], -1),
        )

    def with_states(self, rows: IntArray, track: Track, sources: IntArray) -> Track:
        """Replace the states at `rows`, (n,), by those of another track at `sources`, repeated if these are fewer."""
        chosen = np.arange(len(self.seen))
        chosen[rows] = len(self.seen) + np.resize(sources, len(rows))
        own_joints, joints = self.joints, track.joints
        joined = Track(
            np.concatenate([self.seen, track.seen]),
            concatenate([self.pose, track.pose]),
            None if own_joints is None or joints is None else np.concatenate([own_joints, joints]),
            np.concatenate(
                [self.stop_number, np.where(track.seen, track.stop_number + self.stop_number.max() + 1, -1)]
            ),
            self.has_only_poses,
        )
        return joined.take(chosen)

    @property
    def joint_count(self) -> int:
        """Number of recorded joints; 0 if poses were recorded."""
        return 0 if self.joints is None else self.joints.shape[1]

    @property
    def moves(self) -> bool:
        """Whether the robot has more than one stop."""
        return len(np.unique(self.stop_number[self.seen])) > 1


@dataclass(frozen=True, eq=False)
class Reading:
    """One interpretation of a cell and its recording.

    Attributes:
        cell: The cell under this interpretation.
        problem: The problem under this interpretation.
        order: Numbers of the samples in the order of time, including those without views, (m,).
        tracks: Recorded states at these samples, by robot.
    """

    cell: Cell
    problem: Problem
    order: IntArray
    tracks: Mapping[str, Track]

    @cached_property
    def pose_robots(self) -> list[str]:
        """Robots whose every state is a pose."""
        return [name for name, track in self.tracks.items() if track.has_only_poses]

    @cached_property
    def joint_robots(self) -> list[str]:
        """Robots whose every state has joints."""
        return [name for name, track in self.tracks.items() if track.joints is not None]

    def shows(self, *kinds: type[Measurement]) -> bool:
        """Whether any view is a measurement of one of these kinds."""
        return any(isinstance(group.measurement, kinds) for group in self.problem.groups)

    def restate(self, cell: Cell) -> Reading:
        """Copy with the same views in a cell with other statements about transforms and lenses."""
        return replace(self, cell=cell, problem=restate(cell, self.problem))

    def single_group(self, cell: Cell, group: ViewGroup) -> Reading:
        """Copy with one group of views, in a cell of its own."""
        rows = np.flatnonzero(np.isin(self.order, group.sample))
        tracks = {name: track for name, track in self.tracks.items() if name in cell.robots}
        groups = tuple(g for g in self.problem.groups if (g.camera, g.target) == (group.camera, group.target))
        stops, _ = _stops(self.problem.stops, tracks)
        problem = replace(self.problem, groups=groups, stops=stops)
        return replace(self, problem=problem, tracks=tracks).restate(cell).take(rows)

    def take(self, rows: IntArray) -> Reading:
        """Copy with the samples at these rows."""
        tracks = {name: track.take(rows) for name, track in self.tracks.items()}
        return replace(self, order=self.order[rows])._with_tracks(tracks)

    def thin(self, max_count: int) -> Reading:
        """Copy with at most `max_count` samples, spread evenly."""
        count = len(self.order)
        return self if count <= max_count else self.take(np.linspace(0, count - 1, max_count).round().astype(np.int64))

    def with_poses(self, robots: tuple[str, ...], pose_map: PoseMap) -> Reading:
        """Copy with the recorded poses of these robots mapped."""
        tracks = {name: self.tracks[name] for name in robots}
        mapped = {name: replace(track, pose=pose_map(track.pose), joints=None) for name, track in tracks.items()}
        return self._with_tracks(mapped)

    def with_joints(self, robots: tuple[str, ...], factor: float) -> Reading:
        """Copy with the recorded joints of these robots multiplied by a factor."""
        tracks = {name: self._robot_track(name, self.tracks[name], factor) for name in robots}
        return self._with_tracks(tracks)

    def _robot_track(self, robot: str, track: Track, factor: float = 1.0) -> Track:
        """Track with joints multiplied by a factor, and poses computed by the kinematics of a robot."""
        chain = self.cell.robots[robot].chain
        if track.joints is None or chain is None:
            return track
        return replace(track, joints=factor * track.joints, pose=chain.forward(factor * track.joints))

    def exchange(self, first: str, second: str) -> Reading:
        """Copy with the states of two robots exchanged."""
        tracks = {
            name: self._robot_track(name, self.tracks[other]) for name, other in ((first, second), (second, first))
        }
        return self._with_tracks(tracks)

    def exchange_states(self, numbers: Mapping[str, IntArray]) -> Reading:
        """Copy with the states of two robots exchanged at these samples, by robot; the fewer states are repeated."""
        first, second = numbers
        rows = {name: np.flatnonzero(np.isin(self.order, samples)) for name, samples in numbers.items()}
        tracks = {
            name: self._robot_track(name, self.tracks[name].with_states(rows[name], self.tracks[other], rows[other]))
            for name, other in ((first, second), (second, first))
        }
        return self._with_tracks(tracks)

    def with_carrier(self, target: str, carrier: str) -> Reading:
        """Copy with a target on the flange of a robot or on the world, with a free mount."""
        moved_target = replace(self.cell.targets[target], on=carrier, mount=Unknown())
        cell = replace(self.cell, targets={**self.cell.targets, target: moved_target})
        robot = None if carrier == WORLD else carrier
        base = None if carrier in (WORLD, cell.reference) else cell.base_name(carrier)

        def set_carrier(group: ViewGroup) -> ViewGroup:
            """Attach the views of the target to the new carrier."""
            if group.target != target:
                return group
            no_stop = np.full(len(group), -1, dtype=np.int64)
            end = End(robot, cell.mount_name(target), base, SE3.identity((len(group),)), no_stop, no_stop)
            return replace(group, ends=(group.eye, end))

        return self.map_groups(set_carrier)._with_tracks({}).restate(cell)

    def shift(self, stream: str | None, count: int, start: int = 0) -> Reading:
        """Copy with one stream shifted: the entry at position i - `count` moves to position i.

        Args:
            stream: A robot's name, or None for the observations.
            count: Number of samples to shift by.
            start: First position to shift; earlier samples stay.

        Returns:
            The reading without the samples that have no entry after the shift.
        """
        position = np.arange(len(self.order))
        source = np.where(position < start, position, position - count)
        return self.pair_stream(
            stream, np.where((source < len(position)) & ((source >= start) | (position < start)), source, -1)
        )

    def pair_stream(self, stream: str | None, source: IntArray) -> Reading:
        """Copy with the entries of one stream taken from positions `source`, (m,); samples with -1 are dropped."""
        kept = source >= 0
        if stream is None:
            destination = np.full(len(source), -1)
            destination[source[kept]] = np.flatnonzero(kept)
            return self._move_views(destination).take(np.flatnonzero(kept))
        track = self.tracks[stream].take(source)
        return self._with_tracks({stream: track}).take(np.flatnonzero(track.seen))

    def _move_views(self, destination: IntArray) -> Reading:
        """Move the views of each position to `destination`, (m,); drop those moved to -1."""
        groups = []
        for group in self.problem.groups:
            positions = destination[self._rows(group)]
            kept = np.flatnonzero(positions >= 0)
            groups.append(replace(group.take(kept), sample=self.order[positions[kept]]))
        return replace(self, problem=self.problem.with_groups(g for g in groups if len(g)))._with_tracks({})

    def _rows(self, group: ViewGroup) -> IntArray:
        """Positions of the samples of a group's views, (n,); -1 for samples that no longer exist."""
        row = {int(number): k for k, number in enumerate(self.order)}
        return np.array([row.get(int(number), -1) for number in group.sample], dtype=np.int64)

    def _with_tracks(self, tracks: Mapping[str, Track]) -> Reading:
        """Copy with new states of some robots; views without a state of their robots are dropped."""
        tracks = {**self.tracks, **tracks}
        stops, first_stops = _stops(self.problem.stops, tracks)
        groups = (self._carry_group(group, tracks, first_stops) for group in self.problem.groups)
        stands = {name: len(np.unique(track.stop_number[track.seen])) for name, track in tracks.items()}
        problem = replace(self.problem, groups=tuple(g for g in groups if len(g)), stops=stops, stop_counts=stands)
        return replace(self, problem=problem, tracks=tracks)

    def _carry_group(self, group: ViewGroup, tracks: Mapping[str, Track], first_stops: Mapping[str, int]) -> ViewGroup:
        """Views of a group with states from new tracks; views without a state of their robots are dropped."""
        rows = self._rows(group)
        kept = rows >= 0
        for robot in group.robots:
            kept[kept] = tracks[robot].seen[rows[kept]]
        rows = rows[kept]
        return group.take(np.flatnonzero(kept)).with_ends(lambda end: _carry_end(end, tracks, rows, first_stops))

    def map_groups(self, change: Callable[[ViewGroup], ViewGroup]) -> Reading:
        """Copy with each group of views replaced by the result of a function."""
        return replace(self, problem=self.problem.with_groups(map(change, self.problem.groups)))

    def with_target_poses(self, pose_map: PoseMap, target: str | None = None) -> Reading:
        """Copy with observed poses mapped, of one target or of all targets."""
        return self._with_views(
            PoseMeasurement,
            lambda views: replace(views, measured_camera_from_target=pose_map(views.measured_camera_from_target)),
            target,
        )

    def with_points(self, factor: float) -> Reading:
        """Copy with observed 3-D points multiplied by a factor; stated sigmas are unchanged."""
        return self._with_views(
            PointMeasurement, lambda views: replace(views, points_in_camera=factor * views.points_in_camera)
        )

    def with_pixels_exchanged(self) -> Reading:
        """Copy with the pixel coordinates u and v exchanged."""
        return self._with_views(PixelMeasurement, lambda views: replace(views, pixels=views.pixels[..., ::-1]))

    def _with_views(self, kind: type[M], change: Callable[[M], M], target: str | None = None) -> Reading:
        """Copy with the views of one kind changed, of one target or of all targets."""
        return self.map_groups(lambda g: _change_views(g, kind, change) if target in (None, g.target) else g)

    def resize(self, factors: Mapping[str, float]) -> Reading:
        """Copy with the points of targets multiplied by factors, by target, in the cell and in its views."""
        targets = dict(self.cell.targets)
        for name, factor in factors.items():
            shape = targets[name].target
            if shape is not None:
                options = scale_lengths(shape.options, factor)
                resized_shape = replace(shape, points=factor * shape.points, options=options)
                targets[name] = replace(targets[name], target=resized_shape)

        def resize_group(group: ViewGroup) -> ViewGroup:
            """Resize the target of a group of views."""
            shape = targets[group.target].target
            if shape is None or group.target not in factors:
                return group
            group = _change_views(group, PixelMeasurement, lambda views: replace(views, points_in_target=shape.points))
            group = _change_views(group, PointMeasurement, lambda views: replace(views, points_in_target=shape.points))
            return group if group.half_turn is None else replace(group, half_turn=half_turn(shape))

        return replace(self.map_groups(resize_group), cell=replace(self.cell, targets=targets))


def declared_reading(cell: Cell, recording: Recording, problem: Problem) -> Reading:
    """Pack a cell and its recording as declared.

    Args:
        cell: The declared cell.
        recording: The recording.
        problem: Problem built from both; timing jitter of single samples is removed.
    """
    samples = canonical_order(recording.samples)
    tracks = {name: _track(cell, name, [s.robots.get(name) for s in samples]) for name in cell.robots}
    groups = tuple(replace(group, motion=None) for group in problem.groups)
    order = np.array([sample.sample for sample in samples], dtype=np.int64)
    return Reading(cell, replace(problem, groups=groups, jitter_s={}, open_jitter=frozenset()), order, tracks)


def _track(cell: Cell, robot: str, states: list[RobotState | None]) -> Track:
    seen = np.array([state is not None for state in states], dtype=bool)
    rows = np.where(seen, np.cumsum(seen) - 1, 0)
    known_states = [state for state in states if state is not None]
    if not known_states:
        identity = SE3.identity((len(states),))
        return Track(seen, identity, None, np.full(len(states), -1, dtype=np.int64), False)
    found = recorded_states(cell, robot, known_states)
    joints = None if found.joints is None else found.joints[rows]
    has_only_poses = all(state.base_from_flange is not None for state in known_states)
    return Track(
        seen, found.base_from_flange[rows], joints, np.where(seen, found.stop_number[rows], -1), has_only_poses
    )


def _stops(stops: Stops, tracks: Mapping[str, Track]) -> tuple[Stops, dict[str, int]]:
    """Stops of the tracks of robots with noise, and the index of each robot's first stop."""
    known = zip(stops.robot, stops.sigma, strict=True)
    sigmas = {name: sigma for name, sigma in known if name in tracks}
    counts = {name: int(tracks[name].stop_number.max(initial=-1)) + 1 for name in sigmas}
    names = [name for name, count in counts.items() for _ in range(count)]
    first = dict(zip(counts, np.cumsum([0, *counts.values()]).tolist(), strict=False))
    return Stops(np.array([sigmas[name] for name in names]).reshape(-1, 6), tuple(names)), first


def _carry_end(end: End, tracks: Mapping[str, Track], rows: IntArray, first_stops: Mapping[str, int]) -> End:
    """End of views with the states of its robot at these samples, (n,)."""
    if end.robot is None:
        return end
    track, first = tracks[end.robot].take(rows), first_stops.get(end.robot)
    stop = np.full(len(rows), -1, dtype=np.int64) if first is None else first + track.stop_number
    return replace(end, base_from_flange=track.pose, joints=track.joints, stop_number=track.stop_number, stop=stop)


def _change_views(group: ViewGroup, kind: type[M], change: Callable[[M], M]) -> ViewGroup:
    """Change the views of a group, and their alternative readings, if they are of one kind."""
    if not isinstance(group.measurement, kind):
        return group
    readings = (change(each) for each in group.readings if isinstance(each, kind))
    pixels = tuple(each for each in readings if isinstance(each, PixelMeasurement))
    return replace(group, measurement=change(group.measurement), readings=pixels)
