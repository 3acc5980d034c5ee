"""Every pattern: a new one is a module, and a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from basecal.cell import RobotState, Sample
from basecal.planning import poses, shifts
from basecal.planning.sketch import Sketch

Pattern = Callable[[Sketch, Mapping[str, RobotState], int, int], list[Sample]]
"""Samples of a sketch, from where the robots are, so many, by a seed."""

PATTERNS: Mapping[str, Pattern] = {
    "poses": poses.plan,
    "shifts": shifts.plan,
}
"""By their names in `basecal capture --pattern`."""
