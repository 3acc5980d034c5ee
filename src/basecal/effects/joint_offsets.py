"""Joint offsets: corrections to add to each recorded joint [rad], (n,).

Offsets up to the first joint that moved are equivalent to a rotation of the base. The offset of the last joint is
equivalent to a rotation of the mounts. If base or mounts are free, such a free offset is fixed at zero as a gauge.
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
    unestimated_chains,
)
from basecal.effects.faces.shared_errors import KINEMATICS, SharedErrors
from basecal.fields.digits import two_digits
from basecal.fields.parameters import Parameters
from basecal.fields.values import Sigma
from basecal.geometry import Array, read_only

NAME = "joint_offsets"
SIGMA_RAD = 0.005  # of a prior: 0.3 deg, wider than the offsets of a mastered arm
_ROUNDING = 1e-9  # of a digit: tolerance of rounding up
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
    """Explain why the data do not determine the offsets of some joints."""
    # Number of leading joints that are equivalent to the base.
    leading = next((row for row in range(case.joint_count) if row not in case.rows), 0)
    ends = {0: "the first joint moves the arm as its base does"}
    if leading > 1:
        ends[0] = f"joints 1 to {leading} move the arm as its base does, in these samples"
    ends[case.joint_count - 1] = "the last one as the mounts on its flange do"
    reasons = [ends[row] for row in case.rows if row in ends]
    if any(row >= leading and row not in ends for row in case.rows):
        reasons.append("the samples hardly move the others alone")
    why = f"{case.joints}: {', '.join(reasons)}"
    if case.by_prior:
        rest = f"the sigmas of {case.base} and of the mounts contain the remaining uncertainty"
        return f"offsets known from their prior alone: {why}; {rest}"
    rest = f"{case.base} and the mounts compensate them, and their sigmas contain the usual size"
    return f"offsets that are unobservable and fixed at zero as a gauge: {why}; {rest}"


def report(robot: str, effect: RobotParameters) -> list[str]:
    """A heading, and a line for each joint."""
    lines = joint_lines(effect, _DEG, "deg", 4)
    return [f"joint offsets of {robot}, to be added to its recorded joints", *lines]


def to_dict(effect: Mapping[str, RobotParameters]) -> dict[str, Any]:
    """The fields of `calibration.json`."""
    if not effect:
        return dict.fromkeys(_KEYS)
    rows = {robot: (e.values, e.sigma, e.covariance, e.seen, e.joints) for robot, e in effect.items()}
    return {key: {robot: row[k] for robot, row in rows.items()} for k, key in enumerate(_KEYS)}


def from_dict(data: Mapping[str, Any]) -> dict[str, RobotParameters]:
    """Read the fields of `calibration.json` into the offsets of each robot."""
    values, _, covariances, seen, names = (data.get(key) or {} for key in _KEYS)
    found = {}
    for robot in values:
        n = len(names[robot])
        covariance = read_only(covariances[robot], (n, n), "joint_offsets_covariance")
        rad, is_seen = read_only(values[robot], (n,), "joint_offsets_rad"), np.array(seen[robot], dtype=bool)
        found[robot] = RobotParameters(tuple(names[robot]), rad, np.sqrt(np.diag(covariance)), is_seen, covariance)
    return found


def suggested_sigma(offsets_rad: Array) -> float:
    """Sigma of a prior that is consistent with found joint offsets [rad]: the largest, rounded up to one digit.

    The sigma is at least that of arms that were mastered, 0.005 rad.
    """
    largest = float(np.abs(offsets_rad).max(initial=SIGMA_RAD))
    digit = 10.0 ** np.floor(np.log10(largest))
    return round(float(np.ceil(largest / digit - _ROUNDING) * digit), 9)


def entry(values: Array) -> str:
    """The entry of cell.yaml that estimates the offsets, with a prior that is consistent with found values."""
    return f"`joint_offsets: {{status: prior, sigma_rad: {suggested_sigma(values)}}}`"


def shared_errors(posture: Posture) -> SharedErrors:
    """A rotation of each joint that is equal at all stops."""
    return SharedErrors(posture.true.joint_derivative, np.ones(posture.chain.n, dtype=bool))


def likely(sigmas: Mapping[str, Array]) -> Words:
    """Describe offsets that the estimated noise indicates."""
    robots, turns = " and ".join(sigmas), np.array([turn for _, turn in sigmas.values()])
    what = f"Joints of {robots} likely have offsets of {two_digits(_DEG * float(turns.max()))} deg (1 sigma)."
    return Words("robot-model", what, (f"To estimate them, write {entry(turns)} at {robots}.",))


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each joint of each robot with a constant offset [rad], then all joints of a robot together."""
    for robot, chain in unestimated_chains(views, NAME):
        moves = moves_by_joint(views, robot, chain, lambda _, joints: np.ones_like(joints))
        yield from joint_candidates("joint-offset", robot, "rad", moves)


def words(effect: FoundEffect) -> Words:
    """Describe the offset of one joint, or of several with the most significant named."""
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
