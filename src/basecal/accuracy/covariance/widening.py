"""A covariance that covers another answer, too, where something is found that noise is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.spectral import spectrum


def solution_step(first: Solution, second: Solution) -> Array:
    """The step from one solution to another in the columns of transforms and lenses, (p,); 0 in all others."""
    step = np.zeros(first.problem.width)
    for name, where in first.problem.columns.items():
        if name in first.state.transforms:
            tangent = (first.state.transforms[name].inverse() @ second.state.transforms[name]).log()
            step[where] = tangent[: where.stop - where.start]
        elif name in first.state.cameras:
            step[where] = second.state.cameras[name].parameters - first.state.cameras[name].parameters
    return step


def largest_shift(solution: Solution, moves: Sequence[Array]) -> Array:
    """The largest of several shifts of the columns, each (p,), in units of the covariance."""
    known = spectrum(solution.covariance)
    return max(moves, key=lambda moved: float(known.squared_mahalanobis(moved)))


def widen(solution: Solution, shift: Array) -> Solution:
    """A solution whose covariance covers the answer with columns that are so much aside, (p,), too."""
    return replace(solution, covariance=solution.covariance + np.outer(shift, shift))
