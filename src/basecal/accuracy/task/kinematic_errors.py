"""Derivatives of an arm's flange at commanded points with respect to its joint and link parameters.

Errors that are not estimated are shared by the recorded stops and all other poses. Each joint offset, and each
translation and rotation of a link, is an independent error. Rotations share one sigma, and translations another. The
recorded poses determine these sigmas, and with them the possible errors in directions that no recorded pose shows. For
example, a mount absorbs an error that shifts the flange equally at all recorded poses, without effect on the residuals.
At other poses, the flange has this error. Source: docs/mathematics.md (14.6).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.effects.faces.robot_parameter import Posture
from basecal.effects.faces.shared_errors import KINEMATICS, SharedErrors
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.errors import NotConverged
from basecal.estimation.noise.random_effects import posture_at_stops
from basecal.estimation.noise.robot_noise import stop_poses
from basecal.estimation.problem.build import recorded_joints
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.robot_parameters import Kinematics, column_derivative
from basecal.geometry import SE3, Array, IntArray
from basecal.kinematics.inverse import inverse

EXPECTED_PRIOR = KINEMATICS._replace(tie=2.0)
"""Prior of the sigmas. The error of joints and links together is not smooth in the pose, so stops are hardly tied."""

_MAPPED_EFFECTS = tuple(name for name, effect in RANDOM_EFFECTS.items() if effect.is_mapped)
MODELS = (*((name,) for name in _MAPPED_EFFECTS), _MAPPED_EFFECTS)
"""Combinations of effects that are tried: each alone, as for calibrated arms with known offsets, and all together."""


def kinematic_errors(
    problem: Problem, state: State, robot: str, kinds: Sequence[str] = MODELS[-1]
) -> SharedErrors | None:
    """Errors of a robot's joints and links that its stops share; None if the robot has no such errors.

    Args:
        problem: The recorded problem.
        state: The estimated state.
        robot: Name of the robot.
        kinds: Kinds of errors to include, an element of `MODELS`.
    """
    at, kinds = posture_at_stops(problem, robot), _open_kinds(problem, robot, kinds)
    if at is None or not kinds:
        return None
    return _errors(kinematics_of_robot(problem, state, robot), at.recorded, kinds)


def error_jacobian(
    problem: Problem, state: State, robot: str, points_in_base_m: Array, kinds: Sequence[str] = MODELS[-1]
) -> Array:
    """Derivative of a robot's flange with respect to its `kinematic_errors`, (n, 6, k) [m, rad], in its base's axes.

    Args:
        problem: The recorded problem.
        state: The estimated state.
        robot: Name of a robot with such errors.
        points_in_base_m: (n, 3) flange positions in the robot's base [m].
        kinds: Kinds of errors to include, an element of `MODELS`.
    """
    kinematics, joints = reach_points(problem, state, robot, points_in_base_m)
    jacobian = _errors(kinematics, joints, _open_kinds(problem, robot, kinds)).by_stop
    return to_base_axes(jacobian, kinematics.forward(joints).rotation)


def _open_kinds(problem: Problem, robot: str, kinds: Sequence[str]) -> list[str]:
    """Select the kinds of errors without a stated prior; empty for a robot without a kinematic chain."""
    if robot not in problem.chains:
        return []
    stated = problem.models[robot].stated if robot in problem.models else {}
    return [kind for kind in kinds if kind not in stated or stated[kind].status != "prior"]


def _errors(kinematics: Kinematics, joints: Array, names: list[str]) -> SharedErrors:
    """Errors of a flange at joint positions, (m, n) [rad], from the named effects."""
    at = Posture(kinematics.chain, joints, kinematics.moved_chain.posture(kinematics.true_joints(joints)))
    shared = [errors(at) for name in names if (errors := RANDOM_EFFECTS[name].by_joints) is not None]
    found = [each for each in shared if each is not None]
    return SharedErrors(
        np.concatenate([each.by_stop for each in found], -1), np.concatenate([each.is_turn for each in found])
    )


_INVERSE_STEPS = 40  # of the inverse kinematics; a point out of reach has the errors of the nearest pose reached


def kinematics_jacobian(
    problem: Problem, state: State, robot: str, points_in_base_m: Array
) -> tuple[Array, IntArray] | None:
    """Derivative of a flange at points with respect to the estimated kinematics of its arm.

    The estimates of joints and links are correlated with the base estimate. A map of the base alone would count the
    effect of a joint offset twice. Source: docs/mathematics.md (14.3).

    Args:
        problem: The recorded problem.
        state: The estimated state.
        robot: Name of the robot.
        points_in_base_m: (n, 3) flange positions in the robot's base [m].

    Returns:
        Derivative, (n, 6, k) in the axes of the base [m, rad], and the columns of the problem, (k,). None if no
        kinematics of the robot are estimated.
    """
    model = problem.robot_model(robot)
    if model is None or not problem.robot_ends(robot):
        return None
    kinematics, joints = reach_points(problem, state, robot, points_in_base_m)
    jacobian = to_base_axes(column_derivative(model, kinematics, joints), kinematics.forward(joints).rotation)
    return jacobian, problem.column_indices(model.widths)


def kinematics_of_robot(problem: Problem, state: State, robot: str) -> Kinematics:
    """Estimated kinematics of a robot with a chain; the stated ones if none are estimated."""
    model = problem.robot_model(robot)
    return Kinematics(problem.chains[robot]) if model is None else state.kinematics(model)


def reach_points(problem: Problem, state: State, robot: str, points_in_base_m: Array) -> tuple[Kinematics, Array]:
    """Kinematics of an arm, and joint positions, (n, joints) [rad], that bring its flange to points.

    The flange has the rotation of the nearest recorded pose at each point.

    Args:
        problem: The recorded problem.
        state: The estimated state.
        robot: Name of a robot with a chain.
        points_in_base_m: (n, 3) points in the robot's base [m].
    """
    kinematics, recorded = kinematics_of_robot(problem, state, robot), recorded_joints(problem, robot)
    poses = kinematics.forward(recorded)
    nearest = _nearest_rows(poses, points_in_base_m)
    start = recorded[nearest]
    stated_from_estimated = kinematics.chain.forward(start) @ kinematics.forward(start).inverse()
    base_from_flange = stated_from_estimated @ SE3(poses.rotation[nearest], points_in_base_m)
    try:
        return kinematics, inverse(kinematics.chain, base_from_flange, start, iterations=_INVERSE_STEPS)
    except NotConverged as error:
        return kinematics, np.asarray(error.state)


def nearest_poses(problem: Problem, robot: str, points_in_base_m: Array) -> SE3:
    """Poses of a flange at points, (n, 3) [m], each with the rotation of the nearest recorded pose."""
    poses, seen = stop_poses(problem, robot)
    return move_nearest(poses[np.flatnonzero(seen)], points_in_base_m)


def move_nearest(poses: SE3, points_in_base_m: Array) -> SE3:
    """Poses at points, (n, 3) [m], each with the rotation of the nearest of the given poses."""
    return SE3(poses.rotation[_nearest_rows(poses, points_in_base_m)], points_in_base_m)


def _nearest_rows(poses: SE3, points_in_base_m: Array) -> IntArray:
    """Indices of the poses nearest to points, (n, 3) [m]; (n,)."""
    return np.asarray(np.linalg.norm(points_in_base_m[:, None] - poses.translation[None], axis=-1).argmin(1))


def to_base_axes(jacobian: Array, base_from_flange: Array) -> Array:
    """Rotate derivatives of a flange, right tangents (n, 6, k), to the axes of its base.

    Args:
        jacobian: (n, 6, k) right tangents of the flange.
        base_from_flange: (n, 3, 3) rotations of the flange in its base.
    """
    return np.concatenate([base_from_flange @ jacobian[:, :3], base_from_flange @ jacobian[:, 3:]], axis=1)
