"""Errors of arms that record only poses: fields that are smooth in the place, and lengths along axes of the base.

A stated repeatability does not imply accuracy. Errors of an uncalibrated arm are those of `effects.smooth_by_place`,
represented by modes at the recorded poses. The part that no recorded pose shows has independent errors of the same
variance. The curvature of a smooth field is observable. A length along one axis is hardly observable: bases and mounts
absorb it, especially if arms face each other.
Source: docs/mathematics.md (11.4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Cell
from basecal.effects import stretch
from basecal.effects.faces.candidates import Candidates, one_candidate, pose_moves
from basecal.effects.faces.effect import SigmaPrior
from basecal.effects.faces.shared_errors import SharedErrors
from basecal.effects.smooth import Modes
from basecal.effects.smooth_by_place import kernel
from basecal.estimation.noise.random_effects import FEWEST_STOPS
from basecal.estimation.noise.robot_noise import count_stops, stop_poses
from basecal.estimation.problem.gauges import LENGTH_M
from basecal.geometry import SE3, Array

KINDS_BY_PLACE = 2
"""Number of kinds of errors by place of an arm that records only poses: smooth errors, and a length."""

FIELD_PRIOR_M = SigmaPrior.spike_and_slab(np.array([6e-5, 2e-4, 6e-4]), KINDS_BY_PLACE)
"""Prior of the sigma of a shift along an axis [m]: zero, that of arms accurate to 0.1 mm, or to 0.5 to 2 mm."""


class PoseField(NamedTuple):
    """A robot's smooth field of errors, for shifts of unit sigma [m]."""

    robot: str
    modes: Modes

    @property
    def width(self) -> int:
        """Number of errors of the field, k."""
        return 6 * int(self.modes.weights.shape[1])

    def flange_tangents(self, poses: SE3) -> Array:
        """Derivative of a flange at poses, (n,), with respect to each error, (n, 6, k), right tangents."""
        shared = SharedErrors.repeat_coordinates(self.modes.values(poses)).rotate_to(poses)
        tangents: Array = shared.by_stop / np.where(shared.is_turn, LENGTH_M, 1.0)
        return tangents

    def unknown_share(self, poses: SE3) -> Array:
        """Share of the variance at poses that no recorded pose shows, (n,)."""
        return np.asarray(np.maximum(1 - np.sum(self.modes.values(poses) ** 2, axis=1), 0.0))

    def candidate(self, situation: Situation) -> Candidates:
        """Return a candidate whose sizes are all errors of the field."""
        return one_candidate("pose-field", self.robot, "m", pose_moves(situation, self.robot, self.flange_tangents))


def fields_prior(width: int) -> SigmaPrior:
    """Prior of the sigmas of all errors of fields, which have a common sigma, (m, width)."""
    prior = FIELD_PRIOR_M if width else SigmaPrior.single_value(0.0)
    return SigmaPrior(np.repeat(prior.sigmas[:, None], width, axis=1), prior.probabilities)


def variances(field_m2: float) -> Array:
    """Variances of shift and rotation per axis, (2,) [m^2, rad^2], from the variance of a field's shifts [m^2]."""
    return np.array([field_m2, field_m2 / LENGTH_M**2])


def stated_fields(cell: Cell, situation: Situation) -> list[PoseField]:
    """Fields of arms that state a repeatability and record only poses."""
    stated = (name for name, robot in cell.robots.items() if robot.noise is not None and not robot.is_total_noise)
    return [field for name in stated if (field := pose_field(situation, name)) is not None]


def pose_field(situation: Situation, robot: str) -> PoseField | None:
    """Field of a robot; None if its joints are recorded, its stops are few, or random effects contain the field."""
    problem = situation.problem
    common = {} if situation.noise is None else situation.noise.common
    has_joints = any(end.joints is not None for end in problem.robot_ends(robot))
    if has_joints or count_stops(problem, robot) < FEWEST_STOPS or any(robot in robots for robots in common.values()):
        return None
    poses, seen = stop_poses(problem, robot)
    return PoseField(robot, Modes.strongest(poses[np.flatnonzero(seen)], kernel))


LENGTH_SHARES = np.array([1e-4, 3e-4, 1e-3])
"""Sigmas of a relative length error: 0.1 mm on a metre for accurate arms, 0.3 to 1 mm for usual arms. Assumed."""

_AXES = 3
LENGTHS_PRIOR = SigmaPrior.spike_and_slab(
    np.concatenate([share * np.eye(_AXES) for share in LENGTH_SHARES]), KINDS_BY_PLACE
)
"""Prior of the sigmas of an arm's length errors, (m, 3): zero, or one sigma along one axis."""


class AxisLengths(NamedTuple):
    """Relative length errors of a robot's poses along the axes of its base."""

    robot: str

    @property
    def width(self) -> int:
        """Number of length errors."""
        return _AXES

    def flange_tangents(self, poses: SE3) -> Array:
        """Derivative of a flange at poses, (n,), with respect to each length error, (n, 6, 3), right tangents."""
        return stretch.flange_tangents(poses)[..., :_AXES]

    def unknown_share(self, poses: SE3) -> Array:
        """Zeros, (n,): the length errors are the same at all poses."""
        return np.zeros(len(poses))

    def candidate(self, situation: Situation) -> Candidates:
        """Return a candidate whose sizes are all length errors."""
        return one_candidate("axis-lengths", self.robot, "", pose_moves(situation, self.robot, self.flange_tangents))


def axis_lengths(cell: Cell, situation: Situation) -> list[AxisLengths]:
    """Length errors of each arm that records only poses, unless it states its total noise or its stops are few."""
    problem = situation.problem
    return [
        AxisLengths(name)
        for name, robot in cell.robots.items()
        if not robot.is_total_noise and name not in situation.chains and count_stops(problem, name) >= FEWEST_STOPS
    ]
