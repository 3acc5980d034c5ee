"""Bending: a robot with recorded poses rotates about its base in proportion to its reach."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views, one_candidate, pose_moves
from basecal.effects.faces.effect import AGAIN, Effect, FoundEffect, Words, format_length
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import cross_matrix


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each robot with a rotation of reach x down [rad/m].

    The base absorbs most of this rotation as a tilt, so the direction of gravity is poorly determined. One candidate
    has gravity along the z axis of the base, as for upright and hanging arms; the other has gravity in any direction.
    """
    for robot in views.robots:
        moves = pose_moves(views, robot, turns_by_reach)
        yield one_candidate("deflection", robot, "rad/m", tuple(None if m is None else m[..., 2:] for m in moves))
        yield one_candidate("deflection", robot, "rad/m", moves)


def turns_by_reach(poses: SE3) -> Array:
    """Derivative of the flange at poses, (n,), with respect to a rotation of reach x down about the base, (n, 6, 3)."""
    turns = np.zeros((len(poses), 6, 3))
    turns[:, 3:] = cross_matrix(poses.translation)
    return np.asarray(poses.inverse().adjoint() @ turns)


def words(effect: FoundEffect) -> Words:
    """Describe the bend and its size."""
    what = f"{effect.about} bends by {format_length(effect.size, effect.covariance, 1e3)} mrad per metre of reach."
    do = f"Record the joints of {effect.about} and estimate its `deflection`, or record where it will work."
    return Words("deflection", what, (do, AGAIN))


EFFECT = Effect(
    "bending",
    candidates=candidates,
    words=words,
    is_by_place=True,
    absent={
        "statement": "an arm whose joints are recorded states `deflection`",
        "size": "a candidate without a prior: only a certain one is reported",
        "unknown": "an arm whose joints are recorded has `deflection`",
        "random": "errors smooth by reach contain it",
        "map": "errors smooth by reach contain it",
        "fault": "sag of joints bends arms",
    },
)
