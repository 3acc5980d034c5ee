"""Joints whose zeros are off: a turn of each joint that is the same at all stops."""

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
    if at is None or is_estimated(problem, robot, "joint_offsets", "link_parameters"):
        return None
    return at_posture(at)


def at_posture(at: Posture) -> CommonErrors | None:
    """See `NoiseTerm`."""
    return CommonErrors(at.true.by_joints, np.ones(at.chain.n, dtype=bool))
