"""How the flange of an arm that is sent to a point moves with the estimated kinematics of the arm.

The estimates of joints and links are not independent of that of the base. A map of the base alone would count the
effect of an arm's offset twice. Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

import numpy as np

from basecal.errors import NotConverged
from basecal.estimation.noise.robot_noise import stands
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.robot_parameters import Kinematics, column_derivative
from basecal.geometry import SE3, Array, IntArray
from basecal.kinematics.inverse import inverse

_INVERSE_STEPS = 40  # of the inverse: a point that is out of reach has the arm's errors where it comes nearest


def moved_by_kinematics(
    problem: Problem, state: State, robot: str, points_in_base_m: Array
) -> tuple[Array, IntArray] | None:
    """Derivative of a flange at points to what is estimated of its arm.

    Args:
        problem: What was recorded.
        state: What was found.
        robot: The robot.
        points_in_base_m: (n, 3) in its base [m].

    Returns:
        (n, 6, k) in the axes of its base [m, rad], and the k columns of the problem they belong to. None if nothing of
        the robot is estimated.
    """
    model = problem.robot_model(robot)
    recorded = recorded_joints(problem, robot)
    if model is None or recorded is None:
        return None
    joints = reach_points(problem, state, robot, recorded, points_in_base_m)
    kinematics = state.kinematics(model)
    moved = to_base_axes(column_derivative(model, kinematics, joints), kinematics.forward(joints).rotation)
    columns = [np.arange(problem.columns[name].start, problem.columns[name].stop) for name in model.widths]
    return moved, np.concatenate(columns)


def kinematics_of_robot(problem: Problem, state: State, robot: str) -> Kinematics:
    """Where the kinematics of a robot with a chain are, as stated unless they are estimated."""
    model = problem.robot_model(robot)
    return Kinematics(problem.chains[robot]) if model is None else state.kinematics(model)


def reach_points(problem: Problem, state: State, robot: str, recorded_joints: Array, points_in_base_m: Array) -> Array:
    """Joints, (n, joints) [rad], that bring a flange to points, turned as in the recorded pose nearest to each.

    Args:
        problem: What was recorded.
        state: What was found.
        robot: A robot with a chain.
        recorded_joints: (m, joints) its joints in all views [rad].
        points_in_base_m: (n, 3) in its base [m].
    """
    kinematics = kinematics_of_robot(problem, state, robot)
    poses = kinematics.forward(recorded_joints)
    nearest = np.linalg.norm(points_in_base_m[:, None] - poses.translation[None], axis=-1).argmin(1)
    start = recorded_joints[nearest]
    as_stated = kinematics.chain.forward(start) @ kinematics.forward(start).inverse()
    base_from_flange = as_stated @ SE3(poses.rotation[nearest], points_in_base_m)
    try:
        return inverse(kinematics.chain, base_from_flange, start, iterations=_INVERSE_STEPS)
    except NotConverged as error:
        return np.asarray(error.state)


def nearest_poses(problem: Problem, robot: str, points_in_base_m: Array) -> SE3:
    """Poses of a flange at points, (n, 3) [m], turned as the recorded pose nearest to each."""
    poses, seen = stands(problem, robot)
    return move_nearest(poses[np.flatnonzero(seen)], points_in_base_m)


def move_nearest(poses: SE3, points_in_base_m: Array) -> SE3:
    """Poses at points, (n, 3) [m], turned as the recorded pose nearest to each."""
    nearest = np.linalg.norm(points_in_base_m[:, None] - poses.translation[None], axis=-1).argmin(1)
    return SE3(poses.rotation[nearest], points_in_base_m)


def to_base_axes(jacobian: Array, base_from_flange: Array) -> Array:
    """Derivatives of a flange, right tangents (n, 6, k), in the axes of its base, by its rotations there, (n, 3, 3)."""
    return np.concatenate([base_from_flange @ jacobian[:, :3], base_from_flange @ jacobian[:, 3:]], axis=1)


def recorded_joints(problem: Problem, robot: str) -> Array | None:
    """Joints of a robot in all views, (m, n) [rad]; None if they were not recorded."""
    found = [end.joints for end in problem.robot_ends(robot) if end.joints is not None]
    return np.concatenate(found) if found else None
