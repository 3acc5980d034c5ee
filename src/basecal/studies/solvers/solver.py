"""The class of a solver: its module in this folder ends in a `SOLVER` of this class."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from basecal.geometry import SE3, Array, BoolArray
from basecal.studies.cells import Settings
from basecal.studies.draws import Draws


@dataclass(frozen=True, eq=False)
class Answers:
    """The answer of a solver to each trial.

    Attributes:
        transform: (b,) the transform that is judged.
        covariance: (b, 6, 6) or (b, 3, 3) of a single point's mount [m, rad]; None if the solver gives none.
        solved: (b,) whether there is an answer.
        reason: Why there is none, where there is none.
    """

    transform: SE3
    covariance: Array | None
    solved: BoolArray
    reason: str = ""


@dataclass(frozen=True)
class Solver:
    """A solver of a study.

    Attributes:
        solve: All trials.
        unfit: Why it cannot solve what settings make; None if it can.
        blocks: Blocks of trials that a chunk has: as many as make writing it worth the while.
    """

    solve: Callable[[Draws], Answers]
    unfit: Callable[[Settings], str | None] = lambda _: None
    blocks: int = 1


def no_answers(count: int, reason: str) -> Answers:
    """No answer to any of so many trials."""
    return Answers(SE3.identity((count,)), None, np.zeros(count, dtype=bool), reason)
