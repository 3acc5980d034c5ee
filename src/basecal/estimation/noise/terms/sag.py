"""Joints that yield to the weight of the links: each by its torque, times a compliance that joints mostly share.

The sigma of turns is that of a joint under the torque of the one that carries most, root of the mean square over stops.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.cell.robot_parameters.kind import Posture
from basecal.estimation.noise.hyperpriors import KINEMATICS
from basecal.estimation.noise.terms.common_errors import CommonErrors
from basecal.estimation.noise.terms.posture_at_stops import is_estimated, posture_at_stops
from basecal.estimation.problem.problem import Problem
from basecal.kinematics import gravity_torques

EXPECTED = KINEMATICS
IS_LEFT = True
IS_SURE = False
FIGURES: Mapping[str, float] = {}
_ALIKE = 0.7  # of the variance of compliances, what all joints of an arm share


def errors(problem: Problem, robot: str) -> CommonErrors | None:
    """See `NoiseTerm`."""
    at = posture_at_stops(problem, robot)
    return None if at is None or is_estimated(problem, robot, "deflection") else at_posture(at)


def at_posture(at: Posture) -> CommonErrors | None:
    """See `NoiseTerm`."""
    if at.chain.masses is None:
        return None
    torques = gravity_torques(at.chain, at.recorded)
    most = float(np.sqrt(np.mean(torques**2, axis=0)).max())
    if not most > 0:
        return None
    by_joint = at.true.by_joints * (torques / most)[:, None, :]
    together = np.concatenate(
        [np.sqrt(_ALIKE) * by_joint.sum(-1, keepdims=True), np.sqrt(1 - _ALIKE) * by_joint], axis=-1
    )
    return CommonErrors(together, np.ones(at.chain.n + 1, dtype=bool))
