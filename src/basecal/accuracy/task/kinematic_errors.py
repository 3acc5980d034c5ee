"""Errors of an arm's joints and links that are not estimated, as its stops and its poses elsewhere share them.

Each joint offset, and each shift and rotation of a link, is an independent error. Rotations share one sigma, and shifts
another. The recorded poses determine these sigmas, and with them the possible errors in directions that no recorded
pose shows. For example, a mount absorbs an error that shifts its flange equally at all poses, and the answer fits as
well. That flange is off by this error when it is sent elsewhere.
Source: docs/mathematics.md (14.6).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.task.arms_at_points import kinematics_of_robot, reach_points, recorded_joints, to_base_axes
from basecal.effects.faces.robot_parameter import Posture
from basecal.effects.faces.shared_errors import KINEMATICS, SharedErrors
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.random_effects import posture_at_stops
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.geometry import Array

EXPECTED_PRIOR = KINEMATICS._replace(tie=2.0)
"""Of their sigmas. What joints and links together leave of a stop is not smooth in its pose, and hardly tied."""

_MAPPED_EFFECTS = tuple(name for name, effect in RANDOM_EFFECTS.items() if effect.is_mapped)
MODELS = (*((name,) for name in _MAPPED_EFFECTS), _MAPPED_EFFECTS)
"""Effects that may be there: each alone, as of calibrated arms whose offsets are known, and all together."""


def kinematic_errors(
    problem: Problem, state: State, robot: str, kinds: Sequence[str] = MODELS[-1]
) -> SharedErrors | None:
    """Errors of a robot's joints and links that its stops share; None if none are open.

    Args:
        problem: What was recorded.
        state: What was found.
        robot: The robot.
        kinds: Those that may be off, of `MODELS`.
    """
    at, kinds = posture_at_stops(problem, robot), _open_kinds(problem, robot, kinds)
    if at is None or not kinds:
        return None
    return _errors(kinematics_of_robot(problem, state, robot), at.recorded, kinds)


def moved_by_errors(
    problem: Problem, state: State, robot: str, points_in_base_m: Array, kinds: Sequence[str] = MODELS[-1]
) -> Array:
    """How the flange of a robot moves with its `kinematic_errors`, (n, 6, k) in the axes of its base [m, rad].

    Args:
        problem: What was recorded.
        state: What was found.
        robot: A robot that has some.
        points_in_base_m: (n, 3) where its flange is, in its base [m].
        kinds: As there.
    """
    recorded = recorded_joints(problem, robot)
    assert recorded is not None
    joints = reach_points(problem, state, robot, recorded, points_in_base_m)
    kinematics = kinematics_of_robot(problem, state, robot)
    moved = _errors(kinematics, joints, _open_kinds(problem, robot, kinds)).by_stop
    return to_base_axes(moved, kinematics.forward(joints).rotation)


def _open_kinds(problem: Problem, robot: str, kinds: Sequence[str]) -> list[str]:
    """Kinds among these whose size no prior states; none of a robot without a chain."""
    if robot not in problem.chains:
        return []
    stated = problem.models[robot].stated if robot in problem.models else {}
    return [kind for kind in kinds if kind not in stated or stated[kind].status != "prior"]


def _errors(kinematics: Kinematics, joints: Array, names: list[str]) -> SharedErrors:
    """Errors of a flange at joints, (m, n), by some effects."""
    at = Posture(kinematics.chain, joints, kinematics.moved_chain.posture(kinematics.true_joints(joints)))
    shared = [errors(at) for name in names if (errors := RANDOM_EFFECTS[name].by_joints) is not None]
    found = [each for each in shared if each is not None]
    return SharedErrors(
        np.concatenate([each.by_stop for each in found], -1), np.concatenate([each.is_turn for each in found])
    )
