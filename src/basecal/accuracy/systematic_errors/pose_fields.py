"""Errors of arms that record poses alone: fields, smooth in the place, and lengths along an axis of the base.

A stated repeatability says nothing of accuracy. Errors of an uncalibrated arm are those of `effects.smooth_by_place`,
by its modes at recorded poses. The part that no recorded pose shows has errors of its own, of the same variance. A
smooth field has a curvature, which shows. A length along one axis hardly does: bases and mounts absorb it, most of all
where arms face one another.
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
from basecal.estimation.noise.robot_noise import count_stops, stands
from basecal.estimation.problem.gauges import LENGTH_M
from basecal.geometry import SE3, Array

KINDS_BY_PLACE = 2
"""In how many ways an arm that records poses alone may err by place: by smooth errors, and by a length."""

PRIOR_M = SigmaPrior.as_often_as_not(np.array([6e-5, 2e-4, 6e-4]), KINDS_BY_PLACE)
"""Of a shift along an axis: none, that of arms accurate to 0.1 mm, or of those sold as 0.5 to 2 mm."""


class PoseField(NamedTuple):
    """A robot's field of errors, at unit shifts [m]."""

    robot: str
    modes: Modes

    @property
    def width(self) -> int:
        """How many errors it has."""
        return 6 * int(self.modes.weights.shape[1])

    def flange_tangents(self, poses: SE3) -> Array:
        """How a flange at poses, (n,), moves with each error, (n, 6, k), right tangents."""
        shared = SharedErrors.repeat_coordinates(self.modes.sizes(poses)).rotate_to(poses)
        tangents: Array = shared.by_stop / np.where(shared.is_turn, LENGTH_M, 1.0)
        return tangents

    def unknown_share(self, poses: SE3) -> Array:
        """Share of the variance at poses that no recorded pose has, (n,)."""
        return np.asarray(np.maximum(1 - np.sum(self.modes.sizes(poses) ** 2, axis=1), 0.0))

    def candidate(self, situation: Situation) -> Candidates:
        """All its errors, as sizes of one candidate."""
        return one_candidate("pose-field", self.robot, "m", pose_moves(situation, self.robot, self.flange_tangents))


def fields_prior(width: int) -> SigmaPrior:
    """The prior of all errors of fields together, one sigma, (m, width)."""
    prior = PRIOR_M if width else SigmaPrior.single_value(0.0)
    return SigmaPrior(np.repeat(prior.sigmas[:, None], width, axis=1), prior.shares)


def variances(field_m2: float) -> Array:
    """Variances of a shift and a turn along an axis, (2,) [m^2, rad^2], by the variance of a field's shifts [m^2]."""
    return np.array([field_m2, field_m2 / LENGTH_M**2])


def stated_fields(cell: Cell, situation: Situation) -> list[PoseField]:
    """Fields of arms that state a repeatability, and record poses alone."""
    stated = (name for name, robot in cell.robots.items() if robot.noise is not None and not robot.is_total_noise)
    return [field for name in stated if (field := pose_field(situation, name)) is not None]


def pose_field(situation: Situation, robot: str) -> PoseField | None:
    """The field of a robot; None if its joints are recorded, it made few stops, or random effects contain one."""
    problem = situation.problem
    common = {} if situation.noise is None else situation.noise.common
    has_joints = any(end.joints is not None for end in problem.robot_ends(robot))
    if has_joints or count_stops(problem, robot) < FEWEST_STOPS or any(robot in of for of in common.values()):
        return None
    poses, seen = stands(problem, robot)
    return PoseField(robot, Modes.strongest(poses[np.flatnonzero(seen)], kernel))


SHARES = np.array([1e-4, 3e-4, 1e-3])
"""Of a length, one sigma: 0.1 mm on a metre of accurate arms, or the 0.3 to 1 mm of usual ones. Assumed."""

_AXES = 3
AXES_PRIOR = SigmaPrior.as_often_as_not(np.concatenate([share * np.eye(_AXES) for share in SHARES]), KINDS_BY_PLACE)
"""Of the lengths of an arm, (m, 3): none, or one sigma along one axis."""


class LongAxes(NamedTuple):
    """The lengths of a robot's poses along the axes of its base, as shares."""

    robot: str

    @property
    def width(self) -> int:
        """How many there are."""
        return _AXES

    def flange_tangents(self, poses: SE3) -> Array:
        """How a flange at poses, (n,), moves with each, (n, 6, 3), right tangents."""
        return stretch.flange_tangents(poses)[..., :_AXES]

    def unknown_share(self, poses: SE3) -> Array:
        """None: they are the same everywhere, (n,)."""
        return np.zeros(len(poses))

    def candidate(self, situation: Situation) -> Candidates:
        """All as sizes of one candidate."""
        return one_candidate("long-axes", self.robot, "", pose_moves(situation, self.robot, self.flange_tangents))


def long_axes(cell: Cell, situation: Situation) -> list[LongAxes]:
    """The lengths of each arm that records poses alone, unless it states all its errors or made few stops."""
    problem = situation.problem
    return [
        LongAxes(name)
        for name, robot in cell.robots.items()
        if not robot.is_total_noise and name not in situation.chains and count_stops(problem, name) >= FEWEST_STOPS
    ]
