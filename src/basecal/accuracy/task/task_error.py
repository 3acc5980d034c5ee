"""Expected error of a calibration at the task, and over the shared workspace of the robots.

Both robots are sent to one point. The error of one flange relative to the other has three parts. The first is the error
of the base between them at this point. The second is the uncertainty of the arms' kinematics, estimated or not. The
third is each robot's own error, of a single stop and smooth in its pose. Source: docs/mathematics.md (14.3).
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

_MODEL_SOURCE = "systematic errors: robots, lens, differing fits"
_CLOCK_SOURCE = "offsets of clocks"


def add_task_error(
    cell: Cell,
    calibration: Calibration,
    settings: Settings,
    solutions: tuple[Solution, Solution, Solution],
    offsets: OpenOffsets | None,
) -> Calibration:
    """Add the expected error to a calibration; with a task, also the error budget, the error map and local fits.

    Args:
        cell: The calibrated cell.
        calibration: Its calibration.
        settings: Settings with the task.
        solutions: The solution as fitted, with the covariance of systematic errors, and with that of clocks, too.
        offsets: Clock offsets that were estimated with the solution; None without any.
    """
    fitted, as_modelled, final = solutions
    widening = final.covariance - fitted.covariance
    arms = ArmErrors(cell, fitted, final, offsets)
    meeting = meeting_error(calibration, arms, settings, widening)
    calibration = replace(calibration, meeting=meeting)
    if settings.task_point is None:
        return calibration
    points_m = task_places(settings.task_point, settings.task_box)
    widenings = {
        _MODEL_SOURCE: as_modelled.covariance - fitted.covariance,
        _CLOCK_SOURCE: final.covariance - as_modelled.covariance,
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
    """Expected error where flanges meet, of the transform into the reference's base with the largest error.

    The points are those of the task, or the recorded target places without a task.

    Args:
        calibration: The calibration, with the noise of its robots.
        arms: Errors of arms about the solution.
        settings: Settings with the task.
        widening: (p, p) part of the solution's covariance that is not due to the problem's noise; zero if None.

    Returns:
        The error, or None if no calibrated transform is into the reference's base.
    """
    task = task_places(settings.task_point, settings.task_box)
    meeting = find_worst_meeting(arms.cell, calibration, arms.solution, task)
    if meeting is None:
        return None
    mean, covariance = meeting_errors(meeting, arms, calibration.noise, widening)
    return pool_errors(covariance[:, :3, :3], mean[:, :3], task)


MAP_STEPS = 5
"""Points on each edge of the box: the error is a smooth function of the place."""

_FLAT_M = 1e-3  # [m] thickness below which a box has one layer


def error_map(
    calibration: Calibration,
    arms: ArmErrors,
    points_m: Array,
    widening: Array | None = None,
) -> ErrorMap | None:
    """Map the expected error over the box around the recorded target places and the task.

    Args:
        calibration: The calibration, with the noise of its robots.
        arms: Errors of arms about the solution.
        points_m: (n, 3) points of the task in the reference's base [m].
        widening: (p, p) part of the solution's covariance that is not due to the problem's noise; zero if None.

    Returns:
        The map, or None if no calibrated transform is into the reference's base.
    """
    problem, state = arms.solution.problem, arms.solution.state
    points = _box(np.concatenate([*(target_places(group, state) for group in problem.groups), points_m]))
    meeting = find_worst_meeting(arms.cell, calibration, arms.solution, points)
    if meeting is None:
        return None
    mean, covariance = meeting_errors(meeting, arms, calibration.noise, widening)
    place, turn = slice(0, 3), slice(3, 6)
    lengths = (length_quantiles(covariance[:, each, each], mean[:, each]) for each in (place, turn))
    return ErrorMap(points, *lengths)


def _box(places: Array) -> Array:
    """Grid of points over the box around places, (m, 3) [m]; the last axis varies fastest."""
    low, high = places.min(0), places.max(0)
    edges = [
        np.linspace(a, b, MAP_STEPS) if b - a > _FLAT_M else np.array([(a + b) / 2])
        for a, b in zip(low, high, strict=True)
    ]
    return np.array([*product(*edges)])
