"""Make a `Problem` of a cell and a recording: samples in canonical order, unusable samples dropped with a finding."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.cell import (
    CandidateObservation,
    Cell,
    Finding,
    Intrinsics,
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Recording,
    RobotState,
    Sample,
    TouchObservation,
)
from basecal.effects.deflection import NAME as DEFLECTION
from basecal.effects.deflection import apply_gravity
from basecal.errors import InputError, count_text
from basecal.estimation.problem.correspondence import half_turn
from basecal.estimation.problem.gauges import held_gauges, point_mounts
from basecal.estimation.problem.measurements import GRIP, alternative_readings, make_measurement
from basecal.estimation.problem.problem import Problem, Stops, check_carriers, sequential_columns
from basecal.estimation.problem.robot_parameters import RobotModel, robot_model
from basecal.estimation.problem.same_stop import stop_numbers
from basecal.estimation.problem.stated_lens import with_usual_error
from basecal.estimation.problem.tied_views import SCENE
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, IntArray

Views = list[tuple[int, Observation]]
_LISTED_SAMPLES = 10  # most samples that a message lists; assumed


class RecordedStates(NamedTuple):
    """States of one robot, (n,) each: poses, stop numbers, and joints (n, k) [rad] if all states have joints."""

    base_from_flange: SE3
    stop_number: IntArray
    joints: Array | None

    @property
    def stop_count(self) -> int:
        """Number of stops."""
        return int(self.stop_number.max(initial=-1)) + 1


class _Poses(NamedTuple):
    """Recorded states of one robot, and the row of each sample that has one."""

    row: Mapping[int, int]
    states: RecordedStates


def build_problem(cell: Cell, recording: Recording) -> tuple[Problem, list[Finding]]:
    """Make the problem of a recording, and findings about samples that are not used.

    Raises:
        InputError: if a camera and the target it sees are on the same body, or a camera with pixels has no lens. It is
            also raised if parameters are requested of a robot that is not recorded by joints, or `correlated_px` is
            stated without `pixel_px`.
    """
    samples = canonical_order(recording.samples)
    findings: list[Finding] = []
    poses = _poses(cell, samples)
    stops = _number_stops(cell, poses)
    views = _views(cell, samples, poses, findings)
    groups = tuple(_group(cell, samples, poses, stops, key, views[key]) for key in sorted(views))
    unstated = frozenset(name for name, robot in cell.robots.items() if robot.noise is None)
    stop_counts = {name: recorded.states.stop_count for name, recorded in poses.items()}
    problem = replace(_problem(cell, groups, stops), unstated=unstated, stop_counts=stop_counts)
    return problem.with_models(_models(cell, problem)), findings


def scene_groups(
    cell: Cell, recording: Recording, problem: Problem, sample_numbers: Mapping[str, Sequence[int]]
) -> tuple[ViewGroup, ...]:
    """Make groups of views of the static scene that share the stops of a problem of the same recording.

    Args:
        cell: The cell.
        recording: Recording with poses of the robots that carry cameras.
        problem: Problem that numbers the stops.
        sample_numbers: Sample numbers of the views, by camera.
    """
    samples = canonical_order(recording.samples)
    index, poses = {sample.sample: i for i, sample in enumerate(samples)}, _poses(cell, samples)
    groups = []
    for camera, numbers in sample_numbers.items():
        eye = _end(cell, poses, problem.stops, camera, [index[number] for number in numbers])
        unmeasured = PoseMeasurement(SE3.identity((len(numbers),)), *np.zeros((2, len(numbers), 6)))
        ends = eye, End.still(SCENE, len(numbers))
        groups.append(ViewGroup(camera, SCENE, ends, np.array(numbers, dtype=np.int64), unmeasured))
    return tuple(groups)


def restate(cell: Cell, problem: Problem) -> Problem:
    """Make the problem of the same views in a cell with other transforms, lenses and robot parameters."""
    restated = replace(
        _problem(cell, problem.groups, problem.stops), unstated=problem.unstated, stop_counts=problem.stop_counts
    )
    return restated.with_models(_models(cell, restated))


def _models(cell: Cell, problem: Problem) -> dict[str, RobotModel]:
    """Kinematic models of the robots that have views and parameters to estimate, by name."""
    models = {}
    for name, robot in cell.robots.items():
        requested = [kind for kind, stated in robot.parameters.items() if stated.status != "fixed"]
        if name in problem.robots and requested:
            if robot.chain is None or not recorded_by_joints(problem, name):
                raise InputError(
                    f"robot {name!r}: to estimate {' and '.join(requested)}, its urdf and joints_rad in every sample "
                    "are needed. Set the status to fixed if poses are recorded"
                )
            joints = recorded_joints(problem, name)
            models[name] = robot_model(name, robot.chain, robot.parameters, joints, free_ends(problem, name))
    return models


def recorded_by_joints(problem: Problem, robot: str) -> bool:
    """Whether all views of a robot are recorded with joints."""
    return all(end.joints is not None for end in problem.robot_ends(robot))


def recorded_joints(problem: Problem, robot: str) -> Array:
    """Distinct recorded joints of a robot whose views all have joints, (m, n) [rad]."""
    joints = [end.joints for end in problem.robot_ends(robot) if end.joints is not None]
    return np.unique(np.concatenate(joints), axis=0)


def free_ends(problem: Problem, robot: str) -> tuple[bool, bool]:
    """Whether the base of a robot is free, and whether everything on its flange is free.

    The reference's base is the world: it counts as free if everything else that is placed in the world is free.
    """
    ends = problem.robot_ends(robot)
    bases = [end.base for end in ends if end.base]
    if len(bases) < len(ends):
        bases = [end.base for group in problem.groups for end in group.ends if end.base]
        bases += [end.mount for end in problem.robot_ends(None) if end.base is None]
    mounts = [end.mount for end in ends]
    base, flange = (all(problem.unknowns[name].status == "free" for name in names) for names in (bases, mounts))
    return base, flange


def canonical_order(samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
    """Sort samples by time, or by number if any has no time; keep the first of those with equal numbers."""
    has_times = all(s.stamp_s is not None for s in samples)
    ordered = sorted(samples, key=lambda s: (s.stamp_s if has_times and s.stamp_s is not None else 0.0, s.sample))
    first: dict[int, Sample] = {}
    for sample in ordered:
        first.setdefault(sample.sample, sample)
    return tuple(first.values())


def _poses(cell: Cell, samples: tuple[Sample, ...]) -> dict[str, _Poses]:
    """Recorded states of all robots, by name."""
    poses = {}
    for name in cell.robots:
        rows_with_state = [i for i, sample in enumerate(samples) if name in sample.robots]
        states = recorded_states(cell, name, [samples[i].robots[name] for i in rows_with_state])
        poses[name] = _Poses({i: row for row, i in enumerate(rows_with_state)}, states)
    return poses


def recorded_states(cell: Cell, robot: str, states: list[RobotState]) -> RecordedStates:
    """Convert states of a robot to arrays.

    Raises:
        InputError: if states are recorded by joints and the robot has no kinematics.
    """
    if not states:
        return RecordedStates(SE3.identity((0,)), np.zeros(0, dtype=np.int64), None)
    base_from_flange = _flanges(cell, robot, states)
    recorded = [state.joints_rad for state in states if state.joints_rad is not None]
    joints = np.stack(recorded) if len(recorded) == len(states) else None
    return RecordedStates(base_from_flange, stop_numbers(base_from_flange, joints, cell.robots[robot].noise), joints)


def _flanges(cell: Cell, robot: str, states: list[RobotState]) -> SE3:
    chain = cell.robots[robot].chain
    rotation = np.empty((len(states), 3, 3))
    translation = np.empty((len(states), 3))
    with_joints = [i for i, s in enumerate(states) if s.joints_rad is not None]
    if with_joints:
        if chain is None:
            raise InputError(f"robot {robot!r} is recorded by joints and has no urdf")
        forward = chain.forward(np.stack([j for s in states if (j := s.joints_rad) is not None]))
        rotation[with_joints], translation[with_joints] = forward.rotation, forward.translation
    for i, state in enumerate(states):
        if state.base_from_flange is not None:
            rotation[i], translation[i] = state.base_from_flange.rotation, state.base_from_flange.translation
    return SE3(rotation, translation)


def _number_stops(cell: Cell, poses: Mapping[str, _Poses]) -> Stops:
    """Stops of all robots with stated noise, one row per stop."""
    sigmas: list[Array] = [np.zeros((0, 6))]
    names: list[str] = []
    for name, recorded in poses.items():
        noise = cell.robots[name].noise
        if noise is not None and np.any(noise):
            names += [name] * recorded.states.stop_count
            sigmas.append(np.broadcast_to(noise, (recorded.states.stop_count, 6)))
    return Stops(np.concatenate(sigmas), tuple(names))


def _views(
    cell: Cell, samples: tuple[Sample, ...], poses: Mapping[str, _Poses], findings: list[Finding]
) -> dict[tuple[str, str, str], Views]:
    views: dict[tuple[str, str, str], Views] = defaultdict(list)
    samples_by_reason: dict[str, list[int]] = defaultdict(list)
    seen_contents: set[Hashable] = set()
    repeated: list[int] = []
    for i, sample in enumerate(samples):
        for observation in sample.observations:
            camera, target = observation.camera, observation.target
            needed, shape = [cell.cameras[camera].on, cell.targets[target].on], cell.targets[target].target
            missing = [r for r in needed if r in cell.robots and i not in poses[r].row]
            if missing:
                samples_by_reason[f"no pose of {missing[0]} in the same sample"].append(sample.sample)
            elif isinstance(observation, CandidateObservation) and (shape is None or not shape.is_point):
                samples_by_reason["candidates for several LEDs, which cannot be distinguished"].append(sample.sample)
            else:
                stops = [int(poses[r].states.stop_number[poses[r].row[i]]) for r in needed if r in cell.robots]
                content = view_content(observation, stops)
                if content in seen_contents:
                    repeated.append(sample.sample)
                else:
                    seen_contents.add(content)
                    for kind in _kinds(observation):
                        views[camera, target, kind].append((i, observation))
    findings += repeated_views(repeated)
    findings += [dropped_samples(numbers, reason) for reason, numbers in samples_by_reason.items()]
    for camera, target, _ in views:
        check_carriers(cell, camera, target)
    return views


def _kinds(observation: Observation) -> tuple[str, ...]:
    """Kinds of measurement of an observation; pixels and candidates are one kind, a clamped part gives two."""
    if isinstance(observation, PixelObservation | CandidateObservation):
        return ("PixelObservation",)
    kind = type(observation).__name__
    return (kind, GRIP) if isinstance(observation, TouchObservation) and observation.kind == "clamp" else (kind,)


def _group(
    cell: Cell,
    samples: tuple[Sample, ...],
    poses: Mapping[str, _Poses],
    stops: Stops,
    key: tuple[str, str, str],
    views: Views,
) -> ViewGroup:
    camera, target, kind = key
    index = [i for i, _ in views]
    shape = cell.targets[target].target
    observations = [o for _, o in views]
    measurement = make_measurement(cell, camera, target, kind, observations)
    readings = alternative_readings(measurement, shape, observations)
    return ViewGroup(
        camera=camera,
        target=target,
        ends=(_end(cell, poses, stops, camera, index), _end(cell, poses, stops, target, index)),
        sample=np.array([samples[i].sample for i in index], dtype=np.int64),
        measurement=measurement,
        readings=readings,
        half_turn=half_turn(shape) if len(readings) and shape is not None else None,
    )


def _end(cell: Cell, poses: Mapping[str, _Poses], stops: Stops, body: str, index: list[int]) -> End:
    """Make the end of a camera or target in the samples of these indices: states of its robot, or a still end."""
    mount, carrier = cell.mount_name(body), (cell.cameras.get(body) or cell.targets[body]).on
    if carrier not in cell.robots:
        return End.still(mount, len(index), cell.plate_name(carrier) if carrier in cell.plates else None)
    states, rows = poses[carrier].states, np.array([poses[carrier].row[i] for i in index])
    base = None if carrier == cell.reference else cell.base_name(carrier)
    joints, stop_number = None if states.joints is None else states.joints[rows], states.stop_number[rows]
    stop_row = stop_number + stops.first[carrier] if carrier in stops.first else np.full(len(rows), -1, dtype=np.int64)
    return End(carrier, mount, base, states.base_from_flange[rows], stop_row, stop_number, joints)


def _problem(cell: Cell, groups: tuple[ViewGroup, ...], stops: Stops) -> Problem:
    unknowns = cell.transforms
    point_names = point_mounts(cell, groups)
    pixel_cameras = sorted({g.camera for g in groups if isinstance(g.measurement, PixelMeasurement)})
    lenses: dict[str, Intrinsics] = {}
    widths = {name: 3 if name in point_names else 6 for name, unknown in unknowns.items() if unknown.status != "fixed"}
    for name in pixel_cameras:
        intrinsics = cell.cameras[name].intrinsics
        assert intrinsics is not None
        lenses[name] = intrinsics = with_usual_error(intrinsics)
        if intrinsics.status != "fixed":
            widths[name] = 4 + cell.cameras[name].distortion_terms
    chains = {
        name: apply_gravity(robot.chain, robot.parameters.get(DEFLECTION))
        for name, robot in cell.robots.items()
        if robot.chain is not None
    }
    exact_targets = frozenset(name for name, target in cell.targets.items() if target.size_sigma == 0)
    return Problem(
        cell.reference,
        groups,
        unknowns,
        point_names,
        lenses,
        stops,
        sequential_columns(widths),
        chains=chains,
        exact_targets=exact_targets,
        gauges=held_gauges(cell, groups),
    )


def view_content(observation: Observation, stops: Sequence[int]) -> Hashable:
    """Hashable content of a view and the stops of its robots; equal for copied views."""
    if isinstance(observation, PoseObservation):
        arrays: list[Array] = [observation.camera_from_target.rotation, observation.camera_from_target.translation]
    elif isinstance(observation, TouchObservation):
        arrays = []
    elif isinstance(observation, PointObservation):
        arrays = [observation.points_in_camera, observation.ids.astype(np.float64)]
    else:
        ids = observation.ids if isinstance(observation, PixelObservation) else np.zeros(0)
        arrays = [observation.pixels, ids.astype(np.float64)]
    return observation.camera, observation.target, *stops, *map(np.ndarray.tobytes, arrays)


def repeated_views(numbers: Sequence[int]) -> list[Finding]:
    """Make a finding about samples, by number, whose views repeat earlier ones; empty if there are none."""
    if not numbers:
        return []
    shown, is_single = _list_samples(numbers), len(numbers) == 1
    subject = f"The view of sample {shown} repeats" if is_single else f"{len(numbers)} views, of sample {shown}, repeat"
    what = f"{subject} that of an earlier sample to the last bit."
    why = f"No camera does that; {'it' if is_single else 'each'} counts once."
    do = ("Look for rows that were copied, and remove them.",)
    return [Finding("duplicate-samples", "info", tuple(map(str, numbers)), what, do, why)]


def dropped_samples(numbers: Sequence[int], reason: str) -> Finding:
    """Make a finding about samples, by number, whose views are not used."""
    subject = f"{count_text(len(numbers), 'view')} {'is' if len(numbers) == 1 else 'are'}"
    what = f"{subject} not used, of sample {_list_samples(numbers)}: {reason}."
    return Finding("dropped-sample", "info", tuple(map(str, numbers)), what)


def _list_samples(numbers: Sequence[int]) -> str:
    """List sample numbers for a message; the first ten of many."""
    return ", ".join(map(str, numbers[:_LISTED_SAMPLES])) + (", ..." if len(numbers) > _LISTED_SAMPLES else "")
