"""What changed between two parts of a recording that each close the loop alone: a tool frame, a base frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.cell import Cell
from basecal.errors import NotConverged
from basecal.estimation.outliers.agreeing_samples import CLEAR_GAP
from basecal.estimation.problem.problem import Problem
from basecal.estimation.solve import Solution, solve_problem
from basecal.geometry import PoseEstimate
from basecal.numerics.spectral import spectrum

_FEWEST_SAMPLES = 4  # of a part: as many as determine a mount and a base with something left over


def changed_frame(problem: Problem, cell: Cell, agreeing: Sequence[int]) -> str:
    """A sentence about the one transform that differs between the samples that agree and the rest; else nothing.

    Args:
        problem: Of all samples.
        cell: What exists.
        agreeing: Numbers of the samples that agree, all before or all after the rest.
    """
    numbers = np.unique(np.concatenate([group.sample for group in problem.groups]))
    is_agreeing = np.isin(numbers, list(agreeing))
    edges = np.flatnonzero(np.diff(is_agreeing))
    if len(edges) != 1 or min(is_agreeing.sum(), (~is_agreeing).sum()) < _FEWEST_SAMPLES:
        return ""
    first_sample = int(numbers[edges[0] + 1])
    try:
        before, after = (solve_problem(_part(problem, first_sample, is_later), cell) for is_later in (False, True))
    except NotConverged:
        return ""
    shared = before.transforms.keys() & after.transforms.keys() - before.observability.unobservable
    sigmas = {name: _sigmas(before.transforms[name], after.transforms[name]) for name in shared}
    first, *others = sorted(sigmas, key=lambda name: -sigmas[name]) or [""]
    is_alone = bool(first) and sigmas[first] > CLEAR_GAP * max((sigmas[name] for name in others), default=1.0)
    return _sentence(first, first_sample, (before, after)) if is_alone else ""


def _part(problem: Problem, first_sample: int, is_later: bool) -> Problem:
    groups = [group.take(np.flatnonzero((group.sample >= first_sample) == is_later)) for group in problem.groups]
    return problem.with_groups(group for group in groups if len(group))


def _sigmas(first: PoseEstimate, second: PoseEstimate) -> float:
    """How far two estimates are from one another, in sigmas of both, for which robots are assumed exact."""
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
        what = f"the poses of {carrier.removesuffix('_flange')} are of another tool frame, or {thing} was mounted anew"
    return f"From sample {first_sample} on {what}: {name} differs by {size}."
