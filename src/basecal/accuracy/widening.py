"""A covariance that covers another answer, too, where something is found that noise is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.spectral import spectrum


def step_between(before: Solution, after: Solution) -> Array:
    """The step from one solution to another in the columns of transforms and lenses, (p,); 0 in all others."""
    step = np.zeros(before.problem.width)
    for name, where in before.problem.columns.items():
        if name in before.state.transforms:
            tangent = (before.state.transforms[name].inverse() @ after.state.transforms[name]).log()
            step[where] = tangent[: where.stop - where.start]
        elif name in before.state.cameras:
            step[where] = after.state.cameras[name].parameters - before.state.cameras[name].parameters
    return step


def largest(solution: Solution, moves: Sequence[Array]) -> Array:
    """Of several shifts of the columns, each (p,), the one that is largest in units of the covariance."""
    known = spectrum(solution.covariance)
    return max(moves, key=lambda moved: float(known.mahalanobis_squared(moved)))


def widened(solution: Solution, moved: Array) -> Solution:
    """A solution whose covariance covers the answer with columns that are so much aside, (p,), too."""
    return replace(solution, covariance=solution.covariance + np.outer(moved, moved))
