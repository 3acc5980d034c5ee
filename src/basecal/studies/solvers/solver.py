"""The interface of a solver: its module in this folder defines `SOLVER`, an instance of `Solver`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from basecal.geometry import SE3, Array, BoolArray
from basecal.studies.cells import Settings
from basecal.studies.draws import Draws


@dataclass(frozen=True, eq=False)
class Answers:
    """Solutions of trials.

    Attributes:
        transform: (b,) the evaluated transform.
        covariance: (b, 6, 6), or (b, 3, 3) for the mount of a single point [m, rad]; None if the solver has none.
        solved: (b,) whether there is a solution.
        reason: Reason of failed trials; empty if all trials are solved.
    """

    transform: SE3
    covariance: Array | None
    solved: BoolArray
    reason: str = ""


@dataclass(frozen=True)
class Solver:
    """A solver of a study.

    Attributes:
        solve: Solves all trials.
        refusal_reason: Returns the reason why the solver does not support settings; None if it does.
        blocks: Blocks of trials in a chunk: more for a fast solver, so that writing a file takes a small share.
    """

    solve: Callable[[Draws], Answers]
    refusal_reason: Callable[[Settings], str | None] = lambda _: None
    blocks: int = 1


def no_answers(count: int, reason: str) -> Answers:
    """Answers of `count` failed trials."""
    return Answers(SE3.identity((count,)), None, np.zeros(count, dtype=bool), reason)
