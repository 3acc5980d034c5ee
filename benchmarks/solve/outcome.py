"""What a solver hands back."""

from __future__ import annotations

from typing import NamedTuple

from basecal.estimation.problem.problem import State
from basecal.geometry import Array


class Outcome(NamedTuple):
    """Cost (sum of squared residuals over sigmas), state, covariance and how often the residuals were linearised.

    The covariance's blocks stand in the order of the problem's columns, tangents as in the package.
    """

    cost: float
    state: State
    covariance: Array
    evaluations: int
