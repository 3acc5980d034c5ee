"""How the flange of an arm that is sent to a point moves with what is estimated of the arm's kinematics.

What is found of joints and links is not independent of where the base was found: a map of the base alone would count
twice what an arm's offset does to both. Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

import numpy as np

from basecal.errors import NotConverged
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.robot_parameters import by_columns
from basecal.geometry import SE3, Array, IntArray
from basecal.kinematics import SerialChain
from basecal.kinematics.inverse import inverse

_STEPS = 40  # of the inverse: a point that is out of reach has the arm's errors where it comes nearest


def moved_by_kinematics(
    problem: Problem, state: State, robot: str, points_in_base_m: Array
) -> tuple[Array, IntArray] | None:
    """Derivative of a flange at points, turned as in the recorded pose nearest to each.

    Args:
        problem: What was recorded.
        state: What was found.
        robot: The robot.
        points_in_base_m: (n, 3) in its base [m].

    Returns:
        (n, 6, k) in the axes of its base [m, rad], and the k columns of the problem they belong to; None of a robot of
        which nothing is estimated.
    """
    model = problem.modelled(robot)
    recorded = _recorded(problem, robot)
    if model is None or recorded is None:
        return None
    kinematics = state.kinematics(model)
    poses = kinematics.forward(recorded)
    apart = np.linalg.norm(points_in_base_m[:, None] - poses.translation[None], axis=-1)
    nearest = recorded[apart.argmin(1)]
    rotation = poses.rotation[apart.argmin(1)]
    as_stated = model.chain.forward(nearest) @ kinematics.forward(nearest).inverse()
    joints = _joints(model.chain, as_stated @ SE3(rotation, points_in_base_m), nearest)
    moved = by_columns(model, kinematics, joints)
    axes = kinematics.forward(joints).rotation
    columns = [np.arange(problem.columns[name].start, problem.columns[name].stop) for name in model.widths]
    turned = [axes @ moved[:, :3], axes @ moved[:, 3:]]
    return np.concatenate(turned, axis=1), np.concatenate(columns)


def _joints(chain: SerialChain, poses: SE3, start: Array) -> Array:
    try:
        return inverse(chain, poses, start, iterations=_STEPS)
    except NotConverged as error:
        return np.asarray(error.state)


def _recorded(problem: Problem, robot: str) -> Array | None:
    """Joints of a robot in all views, (m, n) [rad]; None where they were not recorded."""
    found = [
        joints
        for group in problem.groups
        for name, joints in ((group.eye, group.eye_joints), (group.hand, group.hand_joints))
        if name == robot and joints is not None
    ]
    return np.concatenate(found) if found else None
