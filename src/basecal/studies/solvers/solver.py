"""The face of a solver: a module of this folder with `BLOCKS`, `unfit` and `solve`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Protocol, cast

import numpy as np

from basecal.geometry import SE3, Array, BoolArray
from basecal.studies.cells import Settings
from basecal.studies.draws import Draws


@dataclass(frozen=True, eq=False)
class Answers:
    """What a solver says of each trial.

    Attributes:
        transform: (b,) the transform that is judged.
        covariance: (b, 6, 6) or (b, 3, 3) of a single point's mount [m, rad]; None where the solver gives none.
        solved: (b,) whether there is an answer.
        reason: Why there is none, where there is none.
    """

    transform: SE3
    covariance: Array | None
    solved: BoolArray
    reason: str = ""


class Solver(Protocol):
    """What a module of a solver has."""

    BLOCKS: int
    """Blocks of trials that a chunk has: as many as make writing it worth the while."""

    def unfit(self, settings: Settings) -> str | None:
        """Why it cannot solve what these settings make; None where it can."""

    def solve(self, draws: Draws) -> Answers:
        """All trials."""


@cache
def solver(name: str) -> Solver:
    """The solver of that name."""
    return cast(Solver, import_module(f"basecal.studies.solvers.{name}"))


def unsolved(count: int, reason: str) -> Answers:
    """No answer to any of so many trials."""
    return Answers(SE3.identity((count,)), None, np.zeros(count, dtype=bool), reason)
