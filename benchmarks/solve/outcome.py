"""Result of a solver."""

from __future__ import annotations

from typing import NamedTuple

from basecal.estimation.problem.problem import State
from basecal.geometry import Array


class Outcome(NamedTuple):
    """Cost (sum of squared residuals over sigmas), state, covariance, and number of linearisations.

    The blocks of the covariance are in the order of the problem's columns, with the tangents of the package.
    """

    cost: float
    state: State
    covariance: Array
    evaluations: int
