"""Joint offsets: what is to be added to each recorded joint [rad], (n,).

Offsets up to the first joint that moved rotate the arm as its base does. The last one rotates what the flange carries
as the mounts do. If these are free, a free offset there is held at zero, which defines the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views
from basecal.effects.faces.effect import (
    AGAIN,
    DEGREE,
    Effect,
    FoundEffect,
    RandomEffect,
    SimulatedFault,
    Words,
    clearest_joint,
)
from basecal.effects.faces.robot_parameter import (
    Posture,
    RobotParameter,
    RobotParameters,
    Unobserved,
    draw_by_joint,
    joint_candidates,
    joint_columns,
    joint_lines,
    moves_by_joint,
    open_chains,
)
from basecal.effects.faces.shared_errors import KINEMATICS, SharedErrors
from basecal.fields.parameters import Parameters
from basecal.fields.values import Sigma
from basecal.geometry import Array, read_only

NAME = "joint_offsets"
SIGMA_RAD = 0.005  # of a prior: 0.3 deg, wider than a mastered arm's joints are off
_ROUNDING = 1e-9  # of a digit, that is not rounded up for
_DEG = float(np.degrees(1))
_KEYS = (
    "joint_offsets_rad",
    "joint_offsets_sigma_rad",
    "joint_offsets_covariance",
    "joint_offsets_seen",
    "joint_names",
)


class Stated(Parameters):
    """Prior knowledge of the offsets: the sigma of each [rad]."""

    sigma_rad: Sigma | None = None


def unobserved_reason(case: Unobserved) -> str:
    """Why the data do not hold the offsets of some joints."""
    still = next(
        (row for row in range(case.joint_count) if row not in case.rows), 0
    )  # of the first joints, as many as the base
    ends = {0: "the first joint moves the arm as its base does"}
    if still > 1:
        ends[0] = f"joints 1 to {still} move the arm as its base does, in these samples"
    ends[case.joint_count - 1] = "the last one as the mounts on its flange do"
    reasons = [ends[row] for row in case.rows if row in ends]
    if any(row >= still and row not in ends for row in case.rows):
        reasons.append("the samples hardly move the others alone")
    why = f"{case.joints}: {', '.join(reasons)}"
    if case.by_prior:
        rest = f"the sigmas of {case.base} and of the mounts contain what they leave open"
        return f"offsets known from their prior alone: {why}; {rest}"
    rest = f"{case.base} and the mounts make up for them, and their sigmas contain the usual size"
    return f"offsets that are unobservable and fixed at zero as a gauge: {why}; {rest}"


def report(robot: str, effect: RobotParameters) -> list[str]:
    """A line for each joint."""
    lines = joint_lines(effect, _DEG, "deg", 4)
    return [f"joint offsets of {robot}, to be added to its recorded joints", *lines]


def to_dict(effect: Mapping[str, RobotParameters]) -> dict[str, Any]:
    """The fields of `calibration.json`."""
    if not effect:
        return dict.fromkeys(_KEYS)
    rows = {robot: (of.values, of.sigma, of.covariance, of.seen, of.joints) for robot, of in effect.items()}
    return {key: {robot: row[k] for robot, row in rows.items()} for k, key in enumerate(_KEYS)}


def from_dict(data: Mapping[str, Any]) -> dict[str, RobotParameters]:
    """The values in these fields, by robot."""
    values, _, covariances, seen, names = (data.get(key) or {} for key in _KEYS)
    found = {}
    for robot in values:
        n = len(names[robot])
        covariance = read_only(covariances[robot], (n, n), "joint_offsets_covariance")
        rad, known = read_only(values[robot], (n,), "joint_offsets_rad"), np.array(seen[robot], dtype=bool)
        found[robot] = RobotParameters(tuple(names[robot]), rad, np.sqrt(np.diag(covariance)), known, covariance)
    return found


def suggested_sigma(offsets_rad: Array) -> float:
    """Sigma of a prior of joint offsets that found ones do not contradict [rad]: the largest, to one digit upwards.

    It is not below what is usual of arms that were mastered.
    """
    largest = float(np.abs(offsets_rad).max(initial=SIGMA_RAD))
    digit = 10.0 ** np.floor(np.log10(largest))
    return round(float(np.ceil(largest / digit - _ROUNDING) * digit), 9)


def entry(values: Array) -> str:
    """The entry of cell.yaml that estimates them, with a prior that found values do not contradict."""
    return f"`joint_offsets: {{status: prior, sigma_rad: {suggested_sigma(values)}}}`"


def shared_errors(posture: Posture) -> SharedErrors:
    """A rotation of each joint that is equal at all stops."""
    return SharedErrors(posture.true.joint_derivative, np.ones(posture.chain.n, dtype=bool))


def likely(sigmas: Mapping[str, Array]) -> Words:
    """Offsets that the noise shows."""
    robots, turns = " and ".join(sigmas), np.array([turn for _, turn in sigmas.values()])
    what = f"Joints of {robots} likely have offsets of {_DEG * turns.max():.2g} deg (1 sigma)."
    return Words("robot-model", what, (f"To estimate them, write {entry(turns)} at {robots}.",))


def candidates(views: Views) -> Iterator[Candidates]:
    """Each joint of each robot off by a constant [rad], then all joints of a robot at once."""
    for robot, chain in open_chains(views, NAME):
        moves = moves_by_joint(views, robot, chain, lambda _, joints: np.ones_like(joints))
        yield from joint_candidates("joint-offset", robot, "rad", moves)


def words(effect: FoundEffect) -> Words:
    """One joint, or several with the clearest named."""
    joint, offset = clearest_joint(effect, _DEG, "deg")
    what = f"Joint {joint} of {effect.about} is off by {offset}."
    if effect.joint is None:
        what = f"Several joints of {effect.about} are off; the clearest is joint {joint}, by {offset}."
    do = f"Add it to the recorded joint, or write {entry(effect.size)} at {effect.about} in cell.yaml."
    return Words("robot-model", what, (f"Check the zeros of the joints of {effect.about}.", do, AGAIN))


EFFECT = Effect(
    NAME,
    parameter=RobotParameter(
        Stated,
        "the offset",
        lambda chain, statement: joint_columns(chain, statement.sigma_rad),
        report,
        to_dict,
        from_dict,
        entry,
        turn=lambda _, __, joints: np.ones_like(joints),
        largest_sigma=0.3,
        unobserved=unobserved_reason,
    ),
    random=RandomEffect(
        KINEMATICS,
        "of its joint offsets",
        by_joints=shared_errors,
        likely=likely,
        is_certain=True,
        is_mapped=True,
        replaced_by=(NAME, "link_parameters"),
    ),
    candidates=candidates,
    words=words,
    fault=SimulatedFault(
        "joint-offsets", "deg", DEGREE, 0.2, "the zero of each joint is off, one sigma", draw=draw_by_joint
    ),
)
