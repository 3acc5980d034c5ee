"""Errors of arms that record poses alone, as their stops and their poses elsewhere share them.

A base absorbs most of an error that is smooth in the place. At a recorded place, base and error together are known far
better than either alone. Beyond recorded poses an arm has errors of its own, of the same variance.
Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.task.arms_at_points import nearest_poses, to_base_axes
from basecal.effects.faces.shared_errors import SharedErrors
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.robot_noise import stands
from basecal.estimation.problem.problem import Problem
from basecal.geometry import SE3, Array

POSE_EFFECTS = tuple(name for name, effect in RANDOM_EFFECTS.items() if effect.by_poses is not None)
"""Effects that arms without joints may have, and are models of one error at most."""


def moved_by_pose_errors(problem: Problem, robot: str, points_in_base_m: Array, name: str) -> Array:
    """How the flange of a robot moves with the errors of an effect, (n, 6, k) in the axes of its base [m, rad].

    Args:
        problem: What was recorded.
        robot: A robot that has some.
        points_in_base_m: (n, 3) where its flange is, in its base [m].
        name: One of `POSE_EFFECTS`.
    """
    poses = nearest_poses(problem, robot, points_in_base_m)
    return to_base_axes(_errors_by_modes(problem, robot, poses, name).by_stop, poses.rotation)


def unseen_share(problem: Problem, robot: str, points_in_base_m: Array, name: str) -> Array:
    """Share of the variance of such errors at points that no recorded pose has, (n,)."""
    errors = _errors_by_modes(problem, robot, nearest_poses(problem, robot, points_in_base_m), name)
    known = np.sum(errors.by_stop[:, :3, ~errors.is_turn] ** 2, axis=(1, 2)) / 3
    return np.asarray(np.maximum(1 - known, 0.0))


def _errors_by_modes(problem: Problem, robot: str, poses: SE3, name: str) -> SharedErrors:
    by_poses = RANDOM_EFFECTS[name].by_poses
    assert by_poses is not None
    recorded, seen = stands(problem, robot)
    errors = by_poses(recorded[np.flatnonzero(seen)], poses)
    assert errors is not None
    return errors
