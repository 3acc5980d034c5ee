"""A calibration with what is to be expected of it where the work is done, and over the workspace that robots share.

Both robots are sent to one point. The error of one flange relative to the other has three parts. The first is the error
of the base between them there. The second is the uncertainty of the arms' kinematics, estimated or not. The third is
each robot's own errors, of a single stop and smooth in its pose. Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from basecal.accuracy.systematic_errors.situation import OpenOffsets
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.budget import calibration_budget
from basecal.accuracy.task.expected_error import length_quantiles, pool_errors
from basecal.accuracy.task.local_fits import local_fits
from basecal.accuracy.task.meeting import find_worst_meeting, target_places
from basecal.accuracy.task.meeting_errors import meeting_errors
from basecal.accuracy.task.task import placed_transforms, task_places
from basecal.cell import Calibration, Cell, ErrorMap, MeetingError
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution
from basecal.geometry import Array

_MODEL_SOURCE = "what is systematic: robots, lens, fits that differ"
_CLOCK_SOURCE = "offsets of clocks"


def add_task_error(
    cell: Cell,
    calibration: Calibration,
    settings: Settings,
    steps: tuple[Solution, Solution, Solution],
    offsets: OpenOffsets | None = None,
) -> Calibration:
    """The calibration with the error at the work; if a task is named also with its budget, its map and its parts.

    Args:
        cell: What was calibrated.
        calibration: What came out.
        settings: With the task.
        steps: The solution, the same widened by what noise is not, and that widened by clocks.
        offsets: Of clocks that were estimated beside the solution; None without any.
    """
    fitted, as_modelled, by_clocks = steps
    widening = by_clocks.covariance - fitted.covariance
    arms = ArmErrors(cell, fitted, by_clocks, offsets)
    meeting = meeting_error(calibration, arms, settings, widening)
    calibration = replace(calibration, meeting=meeting)
    if settings.task_point is None:
        return calibration
    points_m = task_places(settings.task_point, settings.task_box)
    widenings = {
        _MODEL_SOURCE: as_modelled.covariance - fitted.covariance,
        _CLOCK_SOURCE: by_clocks.covariance - as_modelled.covariance,
    }
    return replace(
        calibration,
        budget=calibration_budget(cell, calibration, fitted, widenings, points_m),
        error_map=error_map(calibration, arms, points_m, widening),
        local=local_fits(
            fitted, [name for name in placed_transforms(cell) if name in calibration.transforms], settings.task_box
        ),
    )


def meeting_error(
    calibration: Calibration,
    arms: ArmErrors,
    settings: Settings,
    widening: Array | None = None,
) -> MeetingError | None:
    """The error where flanges meet, at the task or else where targets were seen, of what is placed the worst.

    Args:
        calibration: What came out, with the noise of its robots.
        arms: Errors of arms about what it was made of.
        settings: With the task.
        widening: (p, p) what of the solution's covariance is beside the noise of the problem; nothing if None.

    Returns:
        None if nothing found is placed in the reference's base.
    """
    task = task_places(settings.task_point, settings.task_box)
    meeting = find_worst_meeting(arms.cell, calibration, arms.solution, task)
    if meeting is None:
        return None
    mean, covariance = meeting_errors(meeting, arms, calibration.noise, widening)
    return pool_errors(covariance[:, :3, :3], mean[:, :3], task)


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
    problem, state = arms.solution.problem, arms.solution.state
    points = _box(np.concatenate([*(target_places(group, state) for group in problem.groups), points_m]))
    meeting = find_worst_meeting(arms.cell, calibration, arms.solution, points)
    if meeting is None:
        return None
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
