"""Where leaving out and taking back came to rest, whether that is an answer to go by, and which samples agree if not.

`benchmarks.outliers` judges its limits.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from basecal.estimation.least_squares.studentized_residuals import studentize_views
from basecal.estimation.noise.estimate import CONTRADICTED, PLAUSIBLE_PX, UNSUSPECTED_PX
from basecal.estimation.outliers.classify import Classification, is_stated
from basecal.estimation.outliers.inlier_mask import InlierMask
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array, IntArray

_LEAST_KEPT = 0.5  # of the views an answer rests on: fewer may agree by chance
_CLEAR_SHARE = 0.6  # of the views that agree convince, so that no further start is tried
_QUIETER = 4.0  # times less variance: unstated noise spreads over all views alike
_PLAUSIBLE_SIGMAS = 10.0  # residual of poses and points that an answer may have
CLEAR_GAP = 5.0
"""Factor in sigmas between neighbours: noise leaves no such gap."""
_LEAST_SHARE, _MOST_SHARE = 0.3, 0.8  # of the samples: a gap outside the middle is the tail of noise
_FARTHEST = 1e15  # misfits beyond are alike [sigma]


@dataclass(frozen=True, eq=False)
class Consensus:
    """Where leaving out and taking back came to rest: all that was seen, what is used of it, its solution."""

    problem: Problem
    kept: InlierMask
    solution: Solution
    judgement: Classification


def best_consensus(ends: Sequence[Consensus]) -> Consensus | None:
    """The end that rests on most, of those whose views scatter about as little as clearly most views can.

    Unstated noise spreads over all views equally; what leaves most of them with a quarter of its variance is no noise.
    Where all noise is stated, what keeps within it goes before what does not.
    """
    clear = [_spread(e) for e in ends if _inlier_share(e) >= _CLEAR_SHARE]
    limit = _QUIETER * min(clear, default=np.inf)

    def merit(end: Consensus) -> tuple[bool, bool, int]:
        """Within what was stated of all noise; as quiet as others; how many points, or poses, it rests on."""
        stated = is_stated(end.problem) and not end.problem.unstated and _is_within_noise(end)
        used = sum(sum(g.measurement.counts().values()) for g in end.solution.problem.groups)
        return stated, _spread(end) <= limit, used

    return max(ends, key=merit, default=None)


def _spread(end: Consensus) -> float:
    """Variance of whole views: over the stated one, or in pixels where none was stated."""
    unit = 1.0 if is_stated(end.problem) else end.solution.noise.noise.pixel_px**2
    return end.judgement.view_scale.variance * unit


def is_answer(end: Consensus, plain: Solution) -> bool:
    """Whether an end rests on most of the views, fits, is an optimum, and sees what all views together do."""
    sees = end.solution.observability.unobservable <= plain.observability.unobservable
    return sees and end.solution.converged and fits(end.solution) and _inlier_share(end) >= _LEAST_KEPT


def fits(solution: Solution) -> bool:
    """Whether residuals are such as the stated noise explains, or as a detector may have."""
    ratio = float(np.sqrt(solution.cost / max(solution.dof, 1)))
    pixels = [g.measurement for g in solution.problem.groups if isinstance(g.measurement, PixelMeasurement)]
    weights = [m.weight[m.weight > 0] for m in pixels]
    if not weights:
        return ratio < _PLAUSIBLE_SIGMAS or not is_stated(solution.problem)
    return ratio < max(CONTRADICTED, PLAUSIBLE_PX * float(np.median(np.concatenate(weights))))


def implausible(plain: Solution, judgement: Classification) -> bool:
    """Whether scales are such that gross outliers may hide in them."""
    if is_stated(plain.problem):
        return max(judgement.view_scale.variance, judgement.point_scale.variance) > CONTRADICTED**2
    if judgement.view_scale.variance > CONTRADICTED**2:
        return True
    return plain.noise.noise.pixel_px > UNSUSPECTED_PX and "pixel_px" in plain.noise.estimated


def convincing(end: Consensus | None) -> TypeGuard[Consensus]:
    """Whether so many of the views agree, within the noise that was stated or that a detector may have."""
    return end is not None and _inlier_share(end) >= _CLEAR_SHARE and fits(end.solution) and _is_within_noise(end)


def _is_within_noise(end: Consensus) -> bool:
    """Whether whole views scatter no more than the noise in use explains."""
    return end.judgement.view_scale.variance <= CONTRADICTED**2


def _inlier_share(end: Consensus) -> float:
    views = np.concatenate(end.kept.views)
    return float(views.mean()) if len(views) else 0.0


def agreeing_samples(problem: Problem, states: Iterable[State]) -> tuple[int, ...]:
    """Numbers of the samples that a state explains far better than the rest, by the state that explains them best.

    Between the last of them and the first of the rest, misfits in sigmas grow by a factor of five at least. None are
    returned if no state shows such a gap between 30 % and 80 % of the samples.
    """
    found: tuple[float, tuple[int, ...]] = (np.inf, ())
    numbers, row = np.unique(np.concatenate([g.sample for g in problem.groups]), return_inverse=True)
    for state in states:
        squares = studentize_views(problem, state)
        sigmas = np.sqrt(np.concatenate([s.value / np.maximum(s.freedoms, 1) for s in squares]))
        worst = np.zeros(len(numbers))  # view of each sample
        np.maximum.at(worst, row, sigmas)
        found = min(found, _split_at_gap(numbers, worst), key=lambda f: f[0])
    return found[1]


def _split_at_gap(numbers: IntArray, sigmas: Array) -> tuple[float, tuple[int, ...]]:
    """The largest misfit before the first clear gap of the sorted ones, and the samples up to there."""
    order = np.argsort(sigmas, kind="stable")
    ordered = np.clip(sigmas[order], 1.0, _FARTHEST)
    first, last = int(np.ceil(_LEAST_SHARE * len(order))), int(_MOST_SHARE * len(order))
    gaps = np.flatnonzero(ordered[first : last + 1] > CLEAR_GAP * ordered[first - 1 : last])
    if not len(gaps):
        return np.inf, ()
    count = first + int(gaps[0])
    return float(ordered[count - 1]), tuple(sorted(int(n) for n in numbers[order[:count]]))
