"""Gear ratio: each joint turns more than recorded, by a share of its recorded angle, (n,)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from basecal.effects.faces.candidates import Candidates
from basecal.effects.faces.effect import Effect
from basecal.effects.faces.found_effect import AGAIN, FoundEffect, Words, format_with_sigma
from basecal.effects.faces.joint_effect import from_dict, joint_candidates, moves_by_joint, open_chains, to_dict
from basecal.effects.faces.robot_parameter import (
    Columns,
    Posture,
    RobotParameter,
    RobotParameters,
    Unobserved,
    joint_lines,
)
from basecal.effects.faces.simulated_fault import SimulatedFault
from basecal.effects.faces.views import Views
from basecal.fields.parameters import Parameters
from basecal.fields.values import Sigma
from basecal.geometry import Array
from basecal.kinematics import SerialChain

NAME = "gear_ratio"
_KEYS = "ratio_error", "sigma_ratio_error"
_LEAST_TURN_RAD = 0.1  # of which a percent is a milliradian
_PERCENT = 1e-2


class Stated(Parameters):
    """Prior knowledge of the ratios: the sigma of each, as a share."""

    sigma: Sigma | None = None


def columns(chain: SerialChain, statement: Stated) -> Columns:
    """A column for each joint."""
    return Columns(np.eye(chain.n), None if statement.sigma is None else np.full(chain.n, statement.sigma))


def shift(chain: SerialChain, statement: Parameters, joints: Array, values: Array) -> Array:
    """The share of each recorded angle."""
    return (values[..., None, :] if values.ndim > 1 else values) * joints


def derivative(posture: Posture, statement: Parameters, values: Array) -> Array:
    """Derivative of the flange to each share."""
    return posture.true.joint_derivative * posture.recorded[..., None, :]


def unobserved_reason(case: Unobserved) -> str:
    """Why the data do not hold the ratios of some joints."""
    how = "known from their prior alone" if case.by_prior else "that are unobservable"
    return f"gear ratios {how}: {case.joints}: these joints hardly move in these samples, or as a base or mount does"


def report(robot: str, effect: RobotParameters) -> list[str]:
    """A line for each joint."""
    return [f"errors of the gear ratios of {robot}", *joint_lines(effect, 100, "%", 4)]


def entry(values: Array) -> str:
    """The entry of cell.yaml that estimates them, with a prior that found values do not contradict."""
    sigma = float(np.abs(values).max(initial=_PERCENT))
    return f"`gear_ratio: {{status: prior, sigma: {sigma:.1g}}}`"


def candidates(views: Views) -> Iterator[Candidates]:
    """Each joint of each robot by a share of its angle, then all joints of a robot at once."""
    for robot, chain in open_chains(views, NAME):
        moves = moves_by_joint(views, robot, chain, _turning_angles)
        yield from joint_candidates("gear-ratio", robot, "", moves)


def _turning_angles(_: object, joints: Array) -> Array:
    """The angles, (n, joints); 0 of a joint that hardly turns, whose ratio is another offset."""
    return np.asarray(np.where(np.ptp(joints, axis=0) > _LEAST_TURN_RAD, joints, 0.0))


def words(effect: FoundEffect) -> Words:
    """One joint, or several with the clearest named."""
    sigmas = np.sqrt(np.maximum(np.diag(effect.covariance), 0.0))
    clearest = int(np.argmax(np.abs(effect.size) / np.where(sigmas > 0, sigmas, np.inf)))
    joint = clearest if effect.joint is None else effect.joint
    amount = format_with_sigma(100 * effect.size[clearest], 100 * float(sigmas[clearest]))
    what = f"Joint {joint + 1} of {effect.about} turns by {amount} % more than recorded."
    if effect.joint is None:
        what = f"Gear ratios of {effect.about} are off; the clearest is that of joint {joint + 1}, by {amount} %."
    return Words("robot-model", what, (f"Write {entry(effect.size)} at {effect.about} in cell.yaml.", AGAIN))


def draw_fault(size: float, joints: int, rng: np.random.Generator) -> Array:
    """Shares of one sigma."""
    return np.asarray(size * rng.standard_normal(joints))


EFFECT = Effect(
    NAME,
    parameter=RobotParameter(
        Stated,
        "the gear ratio",
        derivative,
        columns,
        report,
        partial(to_dict, NAME, _KEYS),
        partial(from_dict, NAME, _KEYS),
        entry,
        shift=shift,
        largest_sigma=0.1,
        unobserved=unobserved_reason,
    ),
    candidates=candidates,
    words=words,
    fault=SimulatedFault(
        "gear-ratio", "%", _PERCENT, 0.5, "each joint turns more than it says, one sigma", draw=draw_fault
    ),
    absent={
        "size": "industrial gears have a ratio of integers; hobby servos differ by percents, which a prior states",
        "random": "industrial gears have a ratio of integers",
    },
)
