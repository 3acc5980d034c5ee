"""Stretch: poses of a robot have different length scales along different directions, as if one axis were 0.1 % long.

The stretch is the linear field of errors of an arm with recorded poses; its antisymmetric part is a rotation of the
base.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views, one_candidate, pose_moves
from basecal.effects.faces.effect import AGAIN, Effect, FoundEffect, Words, format_length
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import cross_matrix

_STRETCHES = np.concatenate([np.eye(3)[:, :, None] * np.eye(3)[:, None], np.abs(cross_matrix(np.eye(3))) / np.sqrt(2)])


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each robot with recorded poses, with the six coefficients of a symmetric matrix."""
    for robot in views.robots:
        if robot not in views.chains:
            yield one_candidate("stretch", robot, "", pose_moves(views, robot, flange_tangents))


def flange_tangents(poses: SE3) -> Array:
    """Derivatives of flange poses, (n,), with respect to each coefficient, diagonal first, (n, 6, 6) right tangents."""
    tangents = np.zeros((len(poses), 6, 6))
    tangents[:, :3] = poses.rotation.mT @ np.einsum("kij,nj->nik", _STRETCHES, poses.translation)
    return tangents


def words(effect: FoundEffect) -> Words:
    """Describe the total stretch."""
    share = format_length(effect.size, effect.covariance, 100.0)
    what = f"Poses of {effect.about} are stretched by {share} %, not equally in all directions."
    check = f"Check the kinematic calibration of {effect.about}, the length of its axes and its tool."
    return Words("stretch", what, (check, "Record where it will work.", AGAIN))


EFFECT = Effect(
    "stretch",
    candidates=candidates,
    words=words,
    is_by_place=True,
    elsewhere={
        "size": "basecal.accuracy.systematic_errors.pose_fields: of one axis of each arm",
    },
    absent={
        "statement": "links hold a robot's lengths",
        "unknown": "its robot's links are, if joints are recorded",
        "random": "smooth errors contain it",
        "map": "fields of smooth errors contain it",
        "fault": "link-errors makes arms too long or too short",
    },
)
