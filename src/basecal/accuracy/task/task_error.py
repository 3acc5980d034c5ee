"""A calibration with what is to be expected of it where the work is done."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.task.budget import calibration_budget
from basecal.accuracy.task.error_map import error_map
from basecal.accuracy.task.local_fits import local_fits
from basecal.accuracy.task.task import base_transforms
from basecal.cell import Calibration, Cell
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution

_MODEL_SOURCE = "what is systematic: robots, lens, fits that differ"
_CLOCK_SOURCE = "offsets of clocks"


def add_task_error(
    cell: Cell, calibration: Calibration, settings: Settings, steps: tuple[Solution, Solution, Solution]
) -> Calibration:
    """The calibration with its budget, its map and its parts; as it is where no task point is named.

    Args:
        cell: What was calibrated.
        calibration: What came out.
        settings: With the task point.
        steps: The solution, the same widened by what noise is not, and that widened by clocks.
    """
    if settings.task_point is None:
        return calibration
    point_m = np.array(settings.task_point)
    fitted, as_modelled, by_clocks = steps
    widenings = {
        _MODEL_SOURCE: as_modelled.covariance - fitted.covariance,
        _CLOCK_SOURCE: by_clocks.covariance - as_modelled.covariance,
    }
    found = calibration_budget(cell, calibration, fitted, widenings, point_m)
    return replace(
        calibration,
        budget=found,
        error_map=error_map(cell, calibration, by_clocks, point_m, by_clocks.covariance - fitted.covariance),
        local=local_fits(
            fitted, [name for name in base_transforms(cell) if name in calibration.transforms], settings.task_box
        ),
    )
