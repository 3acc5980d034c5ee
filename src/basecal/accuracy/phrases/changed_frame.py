"""Detection of a frame that changed between two parts of a recording, each of which is consistent alone."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from basecal.cell import Cell
from basecal.errors import NotConverged
from basecal.estimation.outliers.consensus import CLEAR_GAP, agreeing_samples
from basecal.estimation.problem.problem import Problem
from basecal.estimation.solve import Solution, solve_problem
from basecal.geometry import PoseEstimate
from basecal.numerics.spectral import spectrum

_FEWEST_SAMPLES = 4  # samples of a part: enough to determine a mount and a base with some redundancy; assumed


class ChangedFrame(NamedTuple):
    """Numbers of the agreeing samples, all before or all after the others, and a sentence about the difference."""

    agreeing: tuple[int, ...]
    sentence: str


def changed_frame(problem: Problem, cell: Cell) -> ChangedFrame | None:
    """Find the one transform that differs between earlier and later samples; None if there is none.

    If a frame changed once, at least one half of the samples has the same frame throughout. The samples that agree with
    the solution of this half end at the change.

    Args:
        problem: Problem of all samples.
        cell: The cell.
    """
    numbers = problem.samples
    if len(numbers) < 2 * _FEWEST_SAMPLES:
        return None
    halves = _solve_parts(problem, cell, int(numbers[len(numbers) // 2]))
    agreeing = agreeing_samples(problem, [half.state for half in halves])
    is_agreeing = np.isin(numbers, agreeing)
    edges = np.flatnonzero(np.diff(is_agreeing))
    if len(edges) != 1 or min(is_agreeing.sum(), (~is_agreeing).sum()) < _FEWEST_SAMPLES:
        return None
    first_sample = int(numbers[edges[0] + 1])
    parts = _solve_parts(problem, cell, first_sample)
    name = _find_difference(*parts) if len(parts) == 2 else ""
    return ChangedFrame(agreeing, _sentence(name, first_sample, parts)) if name else None


def _solve_parts(problem: Problem, cell: Cell, first_sample: int) -> list[Solution]:
    """Solve the samples before `first_sample`, and the others, separately; omit a part that does not converge."""
    parts = []
    for is_later in (False, True):
        with suppress(NotConverged):
            parts.append(solve_problem(_part(problem, first_sample, is_later), cell))
    return parts


def _find_difference(first_part: Solution, second_part: Solution) -> str:
    """Name of the transform that differs far more than all others, in sigmas; "" if there is none."""
    parts = first_part, second_part
    shared = frozenset.intersection(*(frozenset(p.transforms) - frozenset(p.observability.unobservable) for p in parts))
    sigmas = {name: _sigmas(first_part.transforms[name], second_part.transforms[name]) for name in shared}
    largest, *others = sorted(sigmas, key=lambda name: -sigmas[name]) or [""]
    is_alone = bool(largest) and sigmas[largest] > CLEAR_GAP * max((sigmas[name] for name in others), default=1.0)
    return largest if is_alone else ""


def _part(problem: Problem, first_sample: int, is_later: bool) -> Problem:
    return problem.take_views(np.flatnonzero((group.sample >= first_sample) == is_later) for group in problem.groups)


def _sigmas(first: PoseEstimate, second: PoseEstimate) -> float:
    """Mahalanobis distance between two estimates, whose covariances assume exact robots."""
    off = (first.mean.inverse() @ second.mean).log()
    return float(np.sqrt(spectrum(first.covariance + second.covariance).squared_mahalanobis(off)))


def _sentence(name: str, first_sample: int, parts: Sequence[Solution]) -> str:
    carrier, _, thing = name.partition("_from_")
    earlier, later = (part.transforms[name].mean for part in parts)
    off = earlier.inverse() @ later if thing.endswith("_base") else later @ earlier.inverse()
    size = f"{1e3 * np.linalg.norm(off.translation):.0f} mm and {np.degrees(np.linalg.norm(off.rotvec)):.1f} deg"
    if thing.endswith("_base"):
        what = f"the poses of {thing.removesuffix('_base')} are in another base frame, or its base was moved"
    else:
        what = f"the poses of {carrier.removesuffix('_flange')} are of another tool frame, or {thing} was mounted again"
    return f"From sample {first_sample} on {what}: {name} differs by {size}."
