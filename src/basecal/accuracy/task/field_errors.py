"""Errors where flanges meet, by fields of errors of arms that record poses alone.

Within the recorded poses the errors are known as far as the data show, with the part that the answer absorbs. Beyond
them, an arm has the errors of an uncalibrated arm. Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.accuracy.systematic_errors.expected_sizes import size_posterior
from basecal.accuracy.systematic_errors.long_axes import LongAxes
from basecal.accuracy.systematic_errors.pose_fields import PoseField, pose_field, stated_fields, variances
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.arms_at_points import nearest_poses, to_base_axes
from basecal.accuracy.task.meeting import Meeting
from basecal.geometry import SE3, Array


def field_covariance(meeting: Meeting, arms: ArmErrors) -> Array:
    """Covariance of place and rotation where flanges meet, by fields, (n, 6, 6).

    Args:
        meeting: Who meets, and where.
        arms: Errors of arms about what came out.
    """
    situation = arms.situation
    (moved, columns), points_m = meeting.moves, meeting.places_m
    total = np.zeros((len(moved), 6, 6))
    for sizes in arms.sizes:
        by_sizes = np.zeros((len(moved), 6, len(sizes.mean)))
        for error, own in sizes.of_arms:
            if error.robot in points_m:
                poses = nearest_poses(situation.problem, error.robot, points_m[error.robot])
                tangents = to_base_axes(error.flange_tangents(poses), poses.rotation)
                by_sizes[..., own] = meeting.propagate(error.robot, tangents)
                total += _unknown_covariance(error, poses, sizes.field_m2)
        mixed = moved @ (sizes.by_sizes @ sizes.covariance)[columns] @ by_sizes.mT
        total += mixed + mixed.mT + by_sizes @ sizes.covariance @ by_sizes.mT
    stated = {field.robot for field in stated_fields(meeting.cell, situation)}
    return total + _open_fields(situation, {r: at for r, at in points_m.items() if r not in stated})


def _open_fields(situation: Situation, points_m: Mapping[str, Array]) -> Array | float:
    """Errors of robots with estimated noise beyond their recorded poses: within these the noise contains them."""
    total: Array | float = 0.0
    for robot, points in points_m.items():
        field = pose_field(situation, robot)
        if field is not None and robot in situation.problem.unstated:
            poses = nearest_poses(situation.problem, robot, points)
            total = total + _unknown_covariance(field, poses, size_posterior(situation, [field]).field_m2)
    return total


def _unknown_covariance(error: PoseField | LongAxes, poses: SE3, field_m2: float) -> Array:
    """Covariance of a flange beyond recorded poses, (n, 6, 6)."""
    return error.unknown_share(poses)[:, None, None] * np.diag(np.repeat(variances(field_m2), 3))
