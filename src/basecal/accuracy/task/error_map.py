"""The error to be expected where two robots meet, over the workspace that they share.

Both are sent to one point. The error of one flange relative to the other has three parts. The first is the error of the
base between them there. The second is the uncertainty of the arms' kinematics, estimated or not. The third is each
robot's own errors, of a single stop and smooth in its pose.
Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.expected_error import length_quantiles
from basecal.accuracy.task.meeting import make_meeting, target_places, worst_meeting
from basecal.accuracy.task.meeting_errors import meeting_errors
from basecal.accuracy.task.task import base_transforms
from basecal.cell import Calibration, ErrorMap
from basecal.geometry import Array

MAP_STEPS = 5
"""Points along each edge of the box: what lies between is a smooth function of the place."""

_FLAT_M = 1e-3  # a box thinner than that has one layer


def error_map(
    calibration: Calibration,
    arms: ArmErrors,
    points_m: Array,
    widening: Array | None = None,
) -> ErrorMap | None:
    """The expected error over the box around the places where targets were seen, and the task.

    Args:
        calibration: What came out, with the noise of its robots.
        arms: Errors of arms about what it was made of.
        points_m: (n, 3) the task in the reference's base [m].
        widening: (p, p) what of the solution's covariance is beside the noise of the problem; nothing if None.

    Returns:
        None if nothing is known that is placed in the reference's base.
    """
    cell, problem, state = arms.cell, arms.solution.problem, arms.solution.state
    known = [name for name in base_transforms(cell) if name in calibration.transforms]
    if not known:
        return None
    points = _box(np.concatenate([*(target_places(group, state) for group in problem.groups), points_m]))
    meetings = (make_meeting(cell, problem, state, name, points) for name in known)
    meeting = worst_meeting(meetings, arms.solution.covariance)
    mean, at = meeting_errors(meeting, arms, calibration.noise, widening)
    place, turn = slice(0, 3), slice(3, 6)
    lengths = (length_quantiles(at[:, each, each], mean[:, each]) for each in (place, turn))
    return ErrorMap(points, *lengths)


def _box(places: Array) -> Array:
    """Points evenly spread over the box around places, (m, 3), x first."""
    low, high = places.min(0), places.max(0)
    edges = [
        np.linspace(a, b, MAP_STEPS) if b - a > _FLAT_M else np.array([(a + b) / 2])
        for a, b in zip(low, high, strict=True)
    ]
    return np.array([*product(*edges)])
