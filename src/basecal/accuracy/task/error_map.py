"""The error to be expected where two robots meet, over the workspace that they share.

Both are sent to one point: how far their flanges are then from where they should be to one another is the error of the
base between them there, what was estimated of the arms' kinematics, and each robot's own, of a stop by itself and
smooth in its pose.
Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from basecal.accuracy.expected_error import length_quantiles
from basecal.accuracy.task.arms_at_points import moved_by_kinematics
from basecal.accuracy.task.task import Task, least_known, placing, task_at
from basecal.cell import Calibration, Cell, ErrorMap
from basecal.estimation.problem.problem import State, ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import hat
from basecal.registry import NOISE_TERMS

STEPS = 5
"""Points along each edge of the box: what lies between is a smooth function of the place."""

_FLAT_M = 1e-3  # a box thinner than that has one layer


def error_map(cell: Cell, calibration: Calibration, solution: Solution, point_m: Array) -> ErrorMap | None:
    """The expected error over the box around the places where targets were seen, and the task point.

    Args:
        cell: What was calibrated.
        calibration: What came out, with the noise of its robots.
        solution: Where targets were seen.
        point_m: (3,) the task point in the reference's base [m].

    Returns:
        None where nothing is known that is placed in the reference's base.
    """
    known = [name for name in placing(cell) if name in calibration.transforms]
    if not known:
        return None
    places = [seen_at(group, solution.state) for group in solution.problem.groups]
    points = _box(np.concatenate([*places, point_m[None]]))
    transforms = {name: calibration[name].mean for name in known}
    covariances = {name: calibration[name].covariance for name in known}
    task = least_known([task_at(name, transforms, points) for name in known], covariances)
    meeting = list(_meeting(cell, task.transform))
    own = sum((_own_variance(calibration, solution, robot) for robot in meeting), start=np.zeros(2))
    at = _covariances(cell, solution, task, covariances[task.transform], points, meeting)
    lengths = length_quantiles(at[:, :3, :3] + own[0] * np.eye(3))
    angles = length_quantiles(at[:, 3:, 3:] + own[1] * np.eye(3))
    return ErrorMap(points, lengths, angles)


def _covariances(
    cell: Cell, solution: Solution, task: Task, covariance: Array, points_m: Array, meeting: Sequence[str]
) -> Array:
    """Of the place and turn of what meets at points, by all that was estimated, (n, 6, 6) in the axes of the base."""
    moved = np.broadcast_to(np.eye(6), (len(points_m), 6, 6)).copy()
    moved[:, :3, 3:] = -hat(task.points_m)
    arms = []
    for robot in meeting:
        is_reference = robot == cell.reference
        where = points_m if is_reference else task.points_m
        found = moved_by_kinematics(solution.problem, solution.state, robot, where)
        if found is not None:
            turned = solution.state.transforms[task.transform].rotation.T if is_reference else np.eye(3)
            sign = -1.0 if is_reference else 1.0
            arms.append((sign * np.kron(np.eye(2), turned) @ found[0], found[1]))
    if not arms:
        return np.asarray(moved @ covariance @ np.swapaxes(moved, 1, 2))
    own = solution.problem.columns[task.transform]
    columns = np.concatenate([np.arange(own.start, own.stop), *(of for _, of in arms)])
    moved = np.concatenate([moved, *(each for each, _ in arms)], axis=-1)
    return np.asarray(moved @ solution.covariance[np.ix_(columns, columns)] @ np.swapaxes(moved, 1, 2))


def seen_at(group: ViewGroup, state: State) -> Array:
    """Where targets were in the reference's base, (n, 3); the camera instead of one that stays where it is."""
    on_arm = group.hand is not None
    base, mount = (group.hand_base, group.target_mount) if on_arm else (group.eye_base, group.camera_mount)
    poses = group.hand_base_from_hand_flange if on_arm else group.eye_base_from_eye_flange
    world_from_base = SE3.identity() if base is None else state.transforms[base]
    return (world_from_base @ poses @ state.transforms[mount]).translation


def _box(places: Array) -> Array:
    """Points evenly spread over the box around places, (m, 3), x first."""
    low, high = places.min(0), places.max(0)
    edges = [
        np.linspace(a, b, STEPS) if b - a > _FLAT_M else np.array([(a + b) / 2]) for a, b in zip(low, high, strict=True)
    ]
    return np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)


def _meeting(cell: Cell, transform: str) -> Iterator[str]:
    """The robots that a transform brings together."""
    yield cell.reference
    for robot in cell.robots:
        if robot != cell.reference and cell.base_name(robot) == transform:
            yield robot


def _own_variance(calibration: Calibration, solution: Solution, robot: str) -> Array:
    """Mean variance of a robot's own error along an axis, of its flange's place and turn, (2,) [m^2, rad^2]."""
    noise = calibration.noise.get("robots", {}).get(robot)
    if noise is None:
        return np.zeros(2)
    of_stop = solution.noise.robot_variances.get(robot, np.square([*noise["sigma_t_m"], *noise["sigma_r_rad"]]))
    common = [np.square(noise[term]["sigma"]) for term in NOISE_TERMS if term in noise]
    own: Array = np.array([of_stop, *common]).reshape(-1, 2, 3).mean(-1).sum(0)
    return own
