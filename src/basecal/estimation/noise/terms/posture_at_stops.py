"""How an arm that records its joints stood at each of its stops."""

from __future__ import annotations

import numpy as np

from basecal.cell.robot_parameters.kind import Posture
from basecal.estimation.noise.robot_noise import stands, stops_made
from basecal.estimation.problem.build import recorded_by_joints
from basecal.estimation.problem.problem import Problem

_FEWEST_STOPS = 4  # fewer show nothing of what changes with the joints


def posture_at_stops(problem: Problem, robot: str) -> Posture | None:
    """The chain as stated at the joints of each stop, by number; None of few stops, or where not all have joints.

    Stops at which nothing was seen, and that nothing asks for, have the mean of the others' joints.
    """
    chain = problem.chains.get(robot)
    if chain is None or not recorded_by_joints(problem, robot) or stops_made(problem, robot) < _FEWEST_STOPS:
        return None
    seen = stands(problem, robot)[1]
    joints = np.zeros((len(seen), chain.n))
    for group in problem.groups:
        for name, stand, recorded in (
            (group.eye, group.eye_stand, group.eye_joints),
            (group.hand, group.hand_stand, group.hand_joints),
        ):
            if name == robot and recorded is not None:
                joints[stand] = recorded
    joints[~seen] = joints[seen].mean(0)
    return Posture(chain, joints, chain.at(joints))


def is_estimated(problem: Problem, robot: str, *kinds: str) -> bool:
    """Whether some of these kinds of parameters of a robot are estimated, and stand for what stops have in common."""
    model = problem.modelled(robot)
    return model is not None and any(kind in model.columns for kind in kinds)
