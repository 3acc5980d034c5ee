"""Gear ratio: each joint rotates more than recorded by a share of its recorded angle, (n,)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views
from basecal.effects.faces.effect import AGAIN, Effect, FoundEffect, SimulatedFault, Words, clearest_joint
from basecal.effects.faces.robot_parameter import (
    RobotParameter,
    RobotParameters,
    Unobserved,
    draw_by_joint,
    from_dict,
    joint_candidates,
    joint_columns,
    joint_lines,
    moves_by_joint,
    to_dict,
    unestimated_chains,
)
from basecal.fields.parameters import Parameters
from basecal.fields.values import Sigma
from basecal.geometry import Array

NAME = "gear_ratio"
_KEYS = "ratio_error", "sigma_ratio_error"
_LEAST_TURN_RAD = 0.1  # one percent of it is one milliradian
_PERCENT = 1e-2


class Stated(Parameters):
    """Prior knowledge of the gear ratios: the relative sigma of each."""

    sigma: Sigma | None = None


def unobserved_reason(case: Unobserved) -> str:
    """Explain why the data do not determine the gear ratios of some joints."""
    how = "known from their prior alone" if case.by_prior else "that are unobservable"
    return f"gear ratios {how}: {case.joints}: they hardly move, or act as a base or a mount does"


def report(robot: str, effect: RobotParameters) -> list[str]:
    """A heading, and a line for each joint."""
    return [f"errors of the gear ratios of {robot}", *joint_lines(effect, 100, "%", 4)]


def entry(values: Array) -> str:
    """The entry of cell.yaml that estimates the ratios, with a prior that is consistent with found values."""
    sigma = float(np.abs(values).max(initial=_PERCENT))
    return f"`gear_ratio: {{status: prior, sigma: {sigma:.1g}}}`"


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each joint of each robot with a share of its angle, then all joints of a robot together."""
    for robot, chain in unestimated_chains(views, NAME):
        moves = moves_by_joint(views, robot, chain, _turning_angles)
        yield from joint_candidates("gear-ratio", robot, "", moves)


def _turning_angles(_: object, joints: Array) -> Array:
    """Angles of joints, (n, joints); 0 for a joint that hardly rotates, whose ratio acts as an offset."""
    return np.asarray(np.where(np.ptp(joints, axis=0) > _LEAST_TURN_RAD, joints, 0.0))


def words(effect: FoundEffect) -> Words:
    """Describe the error of one joint, or of several with the most significant named."""
    joint, amount = clearest_joint(effect, 100, "%")
    relation = "less" if amount.startswith("-") else "more"
    what = f"Joint {joint} of {effect.about} rotates by {amount.removeprefix('-')} {relation} than recorded."
    if effect.joint is None:
        what = f"Gear ratios of {effect.about} are off; the clearest is that of joint {joint}, by {amount}."
    return Words("robot-model", what, (f"Write {entry(effect.size)} at {effect.about} in cell.yaml.", AGAIN))


EFFECT = Effect(
    NAME,
    parameter=RobotParameter(
        Stated,
        "the gear ratio",
        lambda chain, statement: joint_columns(chain, statement.sigma),
        report,
        partial(to_dict, NAME, _KEYS),
        partial(from_dict, NAME, _KEYS),
        entry,
        turn=lambda _, __, joints: joints,
        largest_sigma=0.1,
        unobserved=unobserved_reason,
    ),
    candidates=candidates,
    words=words,
    fault=SimulatedFault(
        "gear-ratio", "%", _PERCENT, 0.5, "each joint rotates more than recorded, one sigma", draw=draw_by_joint
    ),
    absent={
        "size": "industrial gears have a ratio of integers; hobby servos differ by percents, which a prior states",
        "random": "industrial gears have a ratio of integers",
    },
)
