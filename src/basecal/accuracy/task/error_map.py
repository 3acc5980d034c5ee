"""The error to be expected where two robots meet, over the workspace that they share.

Both are sent to one point: how far their flanges are then from where they should be to one another is the error of the
base between them there, what was estimated of the arms' kinematics or is open of it, and each robot's own, of a stop
alone and smooth in its pose.
Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from basecal.accuracy.task.expected_error import length_quantiles
from basecal.accuracy.task.meeting_errors import meeting_errors
from basecal.accuracy.task.task import base_transforms, least_known, make_task
from basecal.cell import Calibration, Cell, ErrorMap
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import SE3, Array

MAP_STEPS = 5
"""Points along each edge of the box: what lies between is a smooth function of the place."""

_FLAT_M = 1e-3  # a box thinner than that has one layer


def error_map(
    cell: Cell, calibration: Calibration, solution: Solution, point_m: Array, widening: Array | None = None
) -> ErrorMap | None:
    """The expected error over the box around the places where targets were seen, and the task point.

    Args:
        cell: What was calibrated.
        calibration: What came out, with the noise of its robots.
        solution: Where targets were seen.
        point_m: (3,) the task point in the reference's base [m].
        widening: (p, p) what of the solution's covariance is beside the noise of the problem; nothing if None.

    Returns:
        None if nothing is known that is placed in the reference's base.
    """
    known = [name for name in base_transforms(cell) if name in calibration.transforms]
    if not known:
        return None
    places = [target_places(group, solution.state) for group in solution.problem.groups]
    points = _box(np.concatenate([*places, point_m[None]]))
    transforms = {name: calibration[name].mean for name in known}
    covariances = {name: calibration[name].covariance for name in known}
    task = least_known([make_task(name, transforms, points) for name in known], covariances)
    mean, at = meeting_errors(cell, calibration, solution, task, points, widening)
    place, turn = slice(0, 3), slice(3, 6)
    lengths = (length_quantiles(at[:, each, each], mean[:, each]) for each in (place, turn))
    return ErrorMap(points, *lengths)


def target_places(group: ViewGroup, state: State) -> Array:
    """Where targets were in the reference's base, (n, 3); the camera instead of one that stays where it is."""
    end = group.eye if group.hand.robot is None else group.hand
    world_from_base = SE3.identity() if end.base is None else state.transforms[end.base]
    return (world_from_base @ end.base_from_flange @ state.transforms[end.mount]).translation


def _box(places: Array) -> Array:
    """Points evenly spread over the box around places, (m, 3), x first."""
    low, high = places.min(0), places.max(0)
    edges = [
        np.linspace(a, b, MAP_STEPS) if b - a > _FLAT_M else np.array([(a + b) / 2])
        for a, b in zip(low, high, strict=True)
    ]
    return np.array([*product(*edges)])
