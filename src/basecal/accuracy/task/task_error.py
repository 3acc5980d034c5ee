"""A calibration with what is to be expected of it where the work is done."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.systematic_errors.situation import OpenOffsets
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.budget import calibration_budget
from basecal.accuracy.task.error_map import error_map
from basecal.accuracy.task.expected_error import pooled_quantile
from basecal.accuracy.task.local_fits import local_fits
from basecal.accuracy.task.meeting import make_meeting, meeting_places, worst_meeting
from basecal.accuracy.task.meeting_errors import meeting_errors
from basecal.accuracy.task.task import base_transforms, place_kind, placed_transforms, task_places
from basecal.cell import Calibration, Cell, MeetingError
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
            fitted, [name for name in base_transforms(cell) if name in calibration.transforms], settings.task_box
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
    cell, solution = arms.cell, arms.solution
    problem, state, task = solution.problem, solution.state, task_places(settings.task_point, settings.task_box)
    meetings = [
        make_meeting(cell, problem, state, name, meeting_places(problem, state, name, task))
        for name in placed_transforms(cell)
        if name in calibration.transforms
    ]
    if not meetings:
        return None
    meeting = worst_meeting(meetings, solution.covariance)
    mean, covariance = meeting_errors(meeting, arms, calibration.noise, widening)
    at, off = covariance[:, :3, :3], mean[:, :3]
    variance = float(np.mean(np.trace(at, axis1=1, axis2=2) + np.sum(off**2, -1)))
    return MeetingError(pooled_quantile(at, off), place_kind(task), float(np.sqrt(variance / 3)))
