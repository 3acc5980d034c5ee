"""Registry of sample patterns: add a module and an entry here for a new pattern."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from basecal.cell import RobotState, Sample
from basecal.planning import poses, shifts
from basecal.planning.sketch import Sketch

Pattern = Callable[[Sketch, Mapping[str, RobotState], int, int], list[Sample]]
"""Function of a sketch, the current robot states, the number of samples and a seed; returns the samples."""

PATTERNS: Mapping[str, Pattern] = {
    "poses": poses.plan,
    "shifts": shifts.plan,
}
"""Patterns by their names in `basecal capture --pattern`."""
