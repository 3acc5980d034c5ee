"""Patterns by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module

from basecal.cell import RobotState, Sample
from basecal.planning.feasible import Feasible
from basecal.planning.sketch import Sketch

Pattern = Callable[[Sketch, Mapping[str, RobotState], Feasible, int, int], list[Sample]]


def pattern(name: str) -> Pattern:
    """The pattern of a registered name: `plan` of its module."""
    found: Pattern = import_module(f"basecal.planning.{name}").plan
    return found
