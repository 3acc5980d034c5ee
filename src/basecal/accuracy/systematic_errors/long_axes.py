"""An axis of an arm's base along which its poses are too long: of arms that record poses alone.

A smooth field of errors has a curvature, which shows. A length along one axis hardly does: bases and mounts absorb it,
most of all where arms face one another. Source: docs/mathematics.md (11.4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.accuracy.systematic_errors.pose_fields import KINDS_BY_PLACE
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Cell
from basecal.effects import stretch
from basecal.effects.faces.candidates import Candidates, one_candidate, pose_moves
from basecal.effects.faces.effect import SigmaPrior
from basecal.estimation.noise.random_effects import FEWEST_STOPS
from basecal.estimation.noise.robot_noise import count_stops
from basecal.geometry import SE3, Array

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
