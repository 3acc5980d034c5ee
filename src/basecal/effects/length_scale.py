"""Length scale of a robot: the translations of its poses are too short by a fraction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views, one_candidate, pose_moves
from basecal.effects.faces.effect import AGAIN, Effect, ExpectedSize, FoundEffect, Words, format_with_sigma
from basecal.geometry import SE3, Array

LENGTHS = ExpectedSize(5e-4, 1.0, "assumed: 0.5 mm on a metre, of arms as delivered", is_stated=True)


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each robot with a length scale."""
    for robot in views.robots:
        yield one_candidate("length-scale", robot, "", pose_moves(views, robot, outward))


def outward(poses: SE3) -> Array:
    """Derivative of flange poses, (n,), with respect to the relative length of an arm, (n, 6, 1), right tangents."""
    moves = np.zeros((*poses.translation.shape[:-1], 6, 1))
    moves[..., :3, :] = poses.rotation.mT @ poses.translation[..., None]
    return moves


def words(effect: FoundEffect) -> Words:
    """Describe by how much poses are too short or too long."""
    percent = 100 * effect.size[0]
    amount = f"{format_with_sigma(abs(percent), 100 * effect.sigma)} %"
    what = f"Poses of {effect.about} are {amount} too {'short' if percent > 0 else 'long'}."
    check = f"Check the kinematic calibration of {effect.about} and the length of its tool."
    return Words("length-scale", what, (check, "Check that the target is printed to scale.", AGAIN))


EFFECT = Effect(
    "length_scale",
    expected=LENGTHS,
    candidates=candidates,
    words=words,
    is_by_place=True,
    absent={
        "statement": "links hold a robot's lengths; poses alone show one number of them",
        "unknown": "its robot's links are",
        "map": "the widened covariance of the answer contains its effect",
        "fault": "link-errors makes arms too long or too short",
    },
)
