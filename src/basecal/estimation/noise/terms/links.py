"""Links that are built otherwise than stated: a shift and a turn of each joint's origin, and of the tip."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.cell.robot_parameters.kind import Posture
from basecal.estimation.noise.hyperpriors import KINEMATICS
from basecal.estimation.noise.terms.common_errors import CommonErrors
from basecal.estimation.noise.terms.posture_at_stops import is_estimated, posture_at_stops
from basecal.estimation.problem.problem import Problem

EXPECTED = KINEMATICS
IS_LEFT = True
IS_SURE = True
FIGURES: Mapping[str, float] = {}


def errors(problem: Problem, robot: str) -> CommonErrors | None:
    """See `NoiseTerm`."""
    at = posture_at_stops(problem, robot)
    if at is None or is_estimated(problem, robot, "link_parameters"):
        return None
    return at_posture(at)


def at_posture(at: Posture) -> CommonErrors | None:
    """See `NoiseTerm`."""
    return CommonErrors(at.true.by_links, np.tile(np.repeat([False, True], 3), at.chain.n + 1))
