"""Random effects of a problem: the errors that the stops of each robot share."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.random_effect import RandomEffect
from basecal.effects.faces.robot_parameter import Posture
from basecal.effects.faces.shared_errors import SharedErrors
from basecal.estimation.noise.robot_noise import count_stops, stands
from basecal.estimation.problem.build import recorded_by_joints
from basecal.estimation.problem.problem import Problem

FEWEST_STOPS = 4
"""Fewer stops show nothing of what changes with the pose."""


def shared_errors(effect: RandomEffect, problem: Problem, robot: str) -> SharedErrors | None:
    """The errors that a robot's stops share by an effect; None if they show none of it, or it is an unknown."""
    model = problem.robot_model(robot)
    if model is not None and not model.columns.keys().isdisjoint(effect.replaced_by):
        return None
    if effect.is_of_poses_alone and recorded_by_joints(problem, robot):
        return None
    if effect.by_poses is not None:
        poses, seen = stands(problem, robot)
        few = count_stops(problem, robot) < FEWEST_STOPS
        return None if few else effect.by_poses(poses[np.flatnonzero(seen)], poses)
    at = posture_at_stops(problem, robot)
    return None if at is None or effect.by_joints is None else effect.by_joints(at)


def posture_at_stops(problem: Problem, robot: str) -> Posture | None:
    """The chain as stated at the joints of each stop, by number; None of few stops, or if not all have joints.

    Stops at which nothing was seen, and that nothing requests, have the mean of the others' joints.
    """
    chain = problem.chains.get(robot)
    if chain is None or not recorded_by_joints(problem, robot) or count_stops(problem, robot) < FEWEST_STOPS:
        return None
    seen = stands(problem, robot)[1]
    joints = np.zeros((len(seen), chain.n))
    for end in problem.robot_ends(robot):
        joints[end.stand] = end.joints
    joints[~seen] = joints[seen].mean(0)
    return Posture(chain, joints, chain.posture(joints))
