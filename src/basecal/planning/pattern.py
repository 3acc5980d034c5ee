"""The class of a pattern: its module in this folder ends in a `PATTERN` of this class."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from basecal.cell import RobotState, Sample
from basecal.planning.sketch import Sketch


@dataclass(frozen=True)
class Pattern:
    """Where arms can be sent by a plan.

    Attributes:
        plan: Samples of a sketch, from where the arms are, so many, by a seed.
    """

    plan: Callable[[Sketch, Mapping[str, RobotState], int, int], list[Sample]]
