"""A calibration with what is to be expected of it where the work is done."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from basecal.accuracy.task.budget import calibration_budget
from basecal.accuracy.task.error_map import error_map
from basecal.cell import Calibration, Cell
from basecal.estimation.solve import Solution
from basecal.geometry import Array

MODEL = "what is systematic: robots, lens, fits that differ"
"""What widens an answer where something is found that noise is not."""

CLOCKS = "offsets of clocks"
"""What widens it where clocks are estimated."""


def at_task(
    cell: Cell, calibration: Calibration, solution: Solution, widenings: Mapping[str, Array], point_m: Array
) -> Calibration:
    """The calibration with its budget and its map; see `calibration_budget` and `error_map`."""
    found = calibration_budget(cell, calibration, solution, widenings, point_m)
    return replace(calibration, budget=found, error_map=error_map(cell, calibration, solution, point_m))
