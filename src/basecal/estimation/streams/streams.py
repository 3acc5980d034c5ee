"""Recordings of asynchronous streams: lines with either robots or observations, each in the clock of its device."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import (
    WORLD,
    Calibration,
    CandidateObservation,
    Cell,
    Clock,
    Finding,
    PixelObservation,
    Recording,
    RobotState,
    RollingShutter,
    Sample,
)
from basecal.errors import InputError
from basecal.estimation.problem.build import dropped_samples
from basecal.estimation.streams.path import LARGEST_GAP_S, Path
from basecal.estimation.streams.rolling_shutter import (
    KnownGeometry,
    RobotMotion,
    correct_rolling_shutter,
    line_time_name,
    mean_row,
)
from basecal.geometry import SE3
from basecal.numerics.batch import space_evenly

_FREE_CLOCK = Clock("free")
_EXACT_CLOCK = Clock()
# Prior of an unstated line time: rolling shutters take 5 to 70 us per row, global shutters zero.
_UNSTATED_SHUTTER = RollingShutter("prior", 0.0, 3e-5)
# Share of views without robots in the same line, above which a recording is asynchronous: the majority; assumed.
_STREAM_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Streams:
    """Records of each device in its own clock.

    Attributes:
        cell: The cell.
        recording: The recording as read.
        paths: Paths of the robots by name, each in its own clock.
        instants: Observations without robots, one sample per camera and stamp.
        clocks: Clock of each robot and camera by name; line times by `line_time_name`.
    """

    cell: Cell
    recording: Recording
    paths: Mapping[str, Path]
    instants: tuple[Sample, ...]
    clocks: Mapping[str, Clock]

    @property
    def estimated_clocks(self) -> tuple[str, ...]:
        """Names of the devices whose clocks, and of the cameras whose line times, are to be estimated."""
        return tuple(name for name, clock in self.clocks.items() if clock.status != "fixed")

    @property
    def stated_offsets(self) -> dict[str, float]:
        """Stated or guessed clock offsets and line times [s], by name."""
        return {name: clock.offset_s for name, clock in self.clocks.items()}

    def thin(self, count: int) -> Streams:
        """Return a copy with at most `count` evenly spaced instants."""
        return replace(self, instants=tuple(self.instants[k] for k in space_evenly(len(self.instants), count)))


@dataclass(frozen=True, eq=False)
class Synchronised:
    """Views with the states of robots at the same times.

    Attributes:
        recording: The synchronised samples.
        robots: Pose and velocity of each robot, by name and sample.
    """

    recording: Recording
    robots: Mapping[str, Mapping[int, RobotMotion]]

    def correct_rows(self, geometry: KnownGeometry, offsets_s: Mapping[str, float]) -> Synchronised:
        """Return a copy with rolling shutter corrected; `offsets_s` as in `synchronise`."""
        lines = {
            camera: offsets_s[line_time_name(camera)]
            for camera in geometry.cell.cameras
            if line_time_name(camera) in offsets_s
        }
        return (
            replace(self, recording=correct_rolling_shutter(self.recording, geometry, lines, self.robots))
            if lines
            else self
        )


def recording_streams(cell: Cell, recording: Recording) -> Streams | None:
    """Separate a recording into streams; None if all robots and cameras share one clock.

    In an asynchronous recording, unstated clocks of cameras are free, and unstated line times have a wide prior about
    zero.

    Raises:
        InputError: if a clock is stated or the recording is asynchronous, and a line has no stamp.
    """
    asynchronous = _is_asynchronous(cell, recording)
    stated = {name: robot.clock for name, robot in cell.robots.items()}
    stated |= {name: camera.clock for name, camera in cell.cameras.items()}
    if not asynchronous and not any(stated.values()) and not _has_rolling_shutter(cell, recording):
        return None
    unstamped = next((s.sample for s in recording.samples if s.stamp_s is None), None)
    if unstamped is not None and not any(stated.values()) and all(s.stamp_s is None for s in recording.samples):
        raise InputError(_missing_poses_message(cell, recording))
    if unstamped is not None:
        why = "clocks are stated" if any(stated.values()) else "robots and views are recorded in separate lines"
        raise InputError(f"sample {unstamped} has no stamp_s, which every line needs: {why}")
    clocks = {
        name: clock or (_FREE_CLOCK if asynchronous and name in cell.cameras else _EXACT_CLOCK)
        for name, clock in stated.items()
    }
    if all(clock.status == "free" for clock in clocks.values()):
        clocks[cell.reference] = Clock("fixed", clocks[cell.reference].offset_s)
    shutters = dict.fromkeys(_pixel_cameras(recording) if asynchronous else (), _UNSTATED_SHUTTER)
    shutters |= {name: c.rolling_shutter for name, c in cell.cameras.items() if c.rolling_shutter is not None}
    clocks |= {line_time_name(name): Clock(s.status, s.line_time_s, s.sigma_s) for name, s in shutters.items()}
    paths = {name: _path(cell, name, recording.samples) for name in cell.robots}
    streams = Streams(cell, recording, paths, tuple(_instants(recording.samples)), clocks)
    _check_overlap(streams)
    return streams


def synchronise(streams: Streams, offsets_s: Mapping[str, float]) -> Synchronised:
    """Interpolate robots at the times of the views, for given clock offsets [s]; views in gaps of a path are left out.

    The time of a view with rolling shutter is that of its mean row; see `Synchronised.correct_rows`.
    """
    needed = [_carrying_robots(streams.cell, sample) for sample in streams.instants]
    times = np.array([s.stamp_s + _stamp_delay(s, offsets_s) for s in streams.instants if s.stamp_s is not None])
    is_usable = np.ones(len(times), dtype=bool)
    for robot, path in streams.paths.items():
        is_needed = np.array([robot in names for names in needed], dtype=bool)
        is_usable &= ~is_needed | path.known_mask(times - offsets_s[robot])
    rows = np.flatnonzero(is_usable)
    states: list[dict[str, RobotState]] = [{} for _ in rows]
    robots: dict[str, dict[int, RobotMotion]] = {}
    for robot, path in streams.paths.items():
        own_rows = [k for k, row in enumerate(rows) if robot in needed[row]]
        points = path.evaluate(times[rows[own_rows]] - offsets_s[robot]) if own_rows else None
        robots[robot] = {}
        for j, k in enumerate(own_rows):
            assert points is not None
            joints = None if points.joints is None else points.joints[j]
            states[k][robot] = RobotState(points.base_from_flange[j] if joints is None else None, joints)
            robots[robot][streams.instants[rows[k]].sample] = RobotMotion(
                points.base_from_flange[j], points.velocity[j]
            )
    samples = tuple(
        replace(streams.instants[row], stamp_s=float(times[row]), robots=state)
        for row, state in zip(rows, states, strict=True)
    )
    skipped = [streams.instants[row].sample for row in np.flatnonzero(~is_usable)]
    findings = (*streams.recording.findings, *_gap_findings(skipped))
    return Synchronised(replace(streams.recording, samples=samples, findings=findings), robots)


def synchronous_recording(cell: Cell, recording: Recording, calibration: Calibration | None = None) -> Recording:
    """Return a recording with robots interpolated at the times of the views.

    Args:
        cell: The cell.
        recording: The recording as read; with a single clock it is returned unchanged.
        calibration: Calibration with estimated clocks and line times; otherwise these are as stated, or guessed.
    """
    streams = recording_streams(cell, recording)
    if streams is None:
        return recording
    if calibration is None:
        return synchronise(streams, streams.stated_offsets).recording
    offsets = streams.stated_offsets | {name: clock.offset_s for name, clock in calibration.clocks.items()}
    offsets |= {line_time_name(name): line.line_time_s for name, line in calibration.line_times.items()}
    stated = {n: c.intrinsics.camera for n, c in cell.cameras.items() if c.intrinsics and c.intrinsics.camera}
    lenses = stated | {name: lens for name, (lens, _) in calibration.cameras.items()}
    geometry = KnownGeometry(cell, calibration.known_transforms(cell), lenses)
    return synchronise(streams, offsets).correct_rows(geometry, offsets).recording


def _is_asynchronous(cell: Cell, recording: Recording) -> bool:
    """Whether most views lack the state of a robot that they need and that is recorded in other lines."""
    recorded = {robot for s in recording.samples for robot in s.robots}
    views = [s for s in recording.samples if s.observations]
    lacking = sum(bool(_carrying_robots(cell, s) & recorded - s.robots.keys()) for s in views)
    return lacking > _STREAM_SHARE * len(views)


def _pixel_cameras(recording: Recording) -> set[str]:
    """Names of the cameras with pixel observations."""
    seen = (o for s in recording.samples for o in s.observations)
    return {o.camera for o in seen if isinstance(o, PixelObservation | CandidateObservation)}


def _missing_poses_message(cell: Cell, recording: Recording) -> str:
    """Message about the robot whose poses most views lack, and how to import them."""
    lacks = [(s.sample, name) for s in recording.samples for name in _carrying_robots(cell, s) - s.robots.keys()]
    robot = Counter(name for _, name in lacks).most_common(1)[0][0]
    numbers = [sample for sample, name in lacks if name == robot]
    others = f", and {len(numbers) - 1} more have none" if len(numbers) > 1 else ""
    lack = f"sample {numbers[0]} has no pose of {robot}{others}"
    return f"{lack}: import its poses; of an arm that stood still one row, basecal import poses ... --still"


def _has_rolling_shutter(cell: Cell, recording: Recording) -> bool:
    """Whether a camera has a rolling shutter and robots are recorded with stamps densely enough to interpolate."""
    stamps = [s.stamp_s for s in recording.samples if s.robots and s.stamp_s is not None]
    rolls = any(camera.rolling_shutter is not None for camera in cell.cameras.values())
    all_stamped = all(s.stamp_s is not None for s in recording.samples)
    return rolls and all_stamped and bool(np.any(np.diff(np.unique(stamps)) <= LARGEST_GAP_S))


def _stamp_delay(sample: Sample, offsets_s: Mapping[str, float]) -> float:
    """Delay of the time of a view after its stamp [s]."""
    camera = _camera(sample)
    line = offsets_s.get(line_time_name(camera), 0.0)
    return offsets_s[camera] + (line * mean_row(sample) if line else 0.0)


def _carrying_robots(cell: Cell, sample: Sample) -> set[str]:
    """Names of the robots that carry cameras or targets of a sample's observations."""
    carriers = {c for o in sample.observations for c in (cell.cameras[o.camera].on, cell.targets[o.target].on)}
    return carriers - {WORLD}


def _camera(sample: Sample) -> str:
    return sample.observations[0].camera


def _instants(samples: Sequence[Sample]) -> Iterator[Sample]:
    """Yield samples of one camera each; observations of further cameras get new sample numbers after all others."""
    number = max((s.sample for s in samples), default=0)
    for sample in samples:
        by_camera = defaultdict(list)
        for observation in sample.observations:
            by_camera[observation.camera].append(observation)
        for k, observations in enumerate(by_camera.values()):
            number += k > 0
            yield replace(
                sample, sample=sample.sample if k == 0 else number, robots={}, observations=tuple(observations)
            )


def _path(cell: Cell, robot: str, samples: Sequence[Sample]) -> Path:
    """Make the recorded path of a robot; of records with equal stamps, the first is used.

    Raises:
        InputError: if the robot is recorded by joints without a urdf, or by both poses and joints.
    """
    stamped = sorted((s.stamp_s, s.sample) for s in samples if robot in s.robots and s.stamp_s is not None)
    states = {s.sample: s.robots[robot] for s in samples if robot in s.robots}
    times, first = np.unique(np.array([stamp for stamp, _ in stamped]), return_index=True)
    kept = [states[stamped[k][1]] for k in first]
    joints = [state.joints_rad for state in kept if state.joints_rad is not None]
    chain = cell.robots[robot].chain
    if not kept:
        return Path(times, SE3.identity((0,)))
    if len(joints) == len(kept):
        if chain is None:
            raise InputError(f"robot {robot!r} is recorded by joints and has no urdf")
        stacked = np.stack(joints)
        return Path(times, chain.forward(stacked), stacked, chain)
    poses = [state.base_from_flange for state in kept if state.base_from_flange is not None]
    if len(poses) < len(kept):
        raise InputError(f"robot {robot!r} is recorded by poses in some lines and by joints in others: give one kind")
    return Path(times, SE3.stack(poses))


def _check_overlap(streams: Streams) -> None:
    """Check that the recorded times of robots and of their views overlap.

    Raises:
        InputError: if they do not, such as for clocks with different epochs.
    """
    for robot, path in streams.paths.items():
        for camera in streams.cell.cameras:
            instants = [
                s for s in streams.instants if _camera(s) == camera and robot in _carrying_robots(streams.cell, s)
            ]
            shift = streams.clocks[camera].offset_s - streams.clocks[robot].offset_s
            stamps = [s.stamp_s + shift for s in instants if s.stamp_s is not None]
            if stamps and len(path.times) and (max(stamps) < path.times[0] or min(stamps) > path.times[-1]):
                raise InputError(
                    f"stamps of {camera} and of {robot} do not overlap: {min(stamps):.3f} to {max(stamps):.3f} s and "
                    f"{path.times[0]:.3f} to {path.times[-1]:.3f} s; write `clock: {{status: free, offset_s: ...}}` at "
                    f"{camera} with the offset to add to its stamps, to about 1 s"
                )


def _gap_findings(numbers: Sequence[int]) -> list[Finding]:
    why = f"no robot was recorded within {LARGEST_GAP_S} s before and after"
    return [dropped_samples(numbers, why)] if numbers else []
