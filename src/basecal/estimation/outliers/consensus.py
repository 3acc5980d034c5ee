"""Candidate solutions of the search for outliers: their choice, their acceptance, and agreeing samples without one.

The thresholds are validated by `benchmarks.outliers`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from basecal.estimation.least_squares.studentized_residuals import view_misfits
from basecal.estimation.noise.estimate import CONTRADICTED, PLAUSIBLE_PX, UNSUSPECTED_PX
from basecal.estimation.outliers.classify import Classification, is_stated
from basecal.estimation.outliers.inlier_mask import InlierMask
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array, IntArray

_LEAST_KEPT = 0.5  # minimum share of inlier views of a solution: fewer may agree by chance
_CLEAR_SHARE = 0.6  # share of inlier views from which no further start is tried
_QUIETER = 4.0  # ratio of variances that unstated noise, which is equal in all views, does not explain
_PLAUSIBLE_SIGMAS = 10.0  # largest plausible rms residual of poses and 3-D points [sigma]
CLEAR_GAP = 5.0
"""Ratio of consecutive sorted deviations, in sigmas, that noise does not cause."""
_LEAST_SHARE, _MOST_SHARE = 0.3, 0.8  # range of samples searched for a gap: beyond it, a gap is the tail of noise
_FARTHEST = 1e15  # [sigma] larger deviations are clipped


@dataclass(frozen=True, eq=False)
class Consensus:
    """Converged inlier selection: the problem with all views, its inliers, their solution and their classification."""

    problem: Problem
    kept: InlierMask
    solution: Solution
    judgement: Classification


def best_consensus(candidates: Sequence[Consensus]) -> Consensus | None:
    """Select the candidate with most inlier residuals among those with a small variance; None without candidates.

    Unstated noise is equal in all views. Deviations whose removal reduces the variance of most views to a quarter are
    therefore outliers. If all noise is stated, candidates consistent with it come first.
    """
    clear_variances = [_view_variance(e) for e in candidates if _inlier_share(e) >= _CLEAR_SHARE]
    limit = _QUIETER * min(clear_variances, default=np.inf)

    def sort_key(candidate: Consensus) -> tuple[bool, bool, int]:
        """Sort key: whether it fits fully stated noise, whether its variance is small, and its number of residuals."""
        is_consistent = is_stated(candidate.problem) and not candidate.problem.unstated and _is_within_noise(candidate)
        residual_count = sum(sum(g.measurement.counts().values()) for g in candidate.solution.problem.groups)
        return is_consistent, _view_variance(candidate) <= limit, residual_count

    return max(candidates, key=sort_key, default=None)


def _view_variance(candidate: Consensus) -> float:
    """Variance of whole views: relative to stated noise, or in squared pixels for unstated noise."""
    unit = 1.0 if is_stated(candidate.problem) else candidate.solution.noise.noise.pixel_px**2
    return candidate.judgement.view_scale.variance * unit


def is_acceptable(candidate: Consensus, plain: Solution) -> bool:
    """Whether a candidate uses at least half of the views, fits them, converged, and loses no observability."""
    is_as_observable = candidate.solution.observability.unobservable <= plain.observability.unobservable
    return (
        is_as_observable
        and candidate.solution.converged
        and has_plausible_residuals(candidate.solution)
        and _inlier_share(candidate) >= _LEAST_KEPT
    )


def has_plausible_residuals(solution: Solution) -> bool:
    """Whether the residuals are consistent with the stated noise, or plausible for a detector."""
    ratio = float(np.sqrt(solution.cost / max(solution.dof, 1)))
    pixels = [g.measurement for g in solution.problem.groups if isinstance(g.measurement, PixelMeasurement)]
    weights = [m.weight[m.weight > 0] for m in pixels]
    if not weights:
        return ratio < _PLAUSIBLE_SIGMAS or not is_stated(solution.problem)
    return ratio < max(CONTRADICTED, PLAUSIBLE_PX * float(np.median(np.concatenate(weights))))


def may_hide_outliers(plain: Solution, judgement: Classification) -> bool:
    """Whether the scales are large enough to hide gross outliers."""
    if is_stated(plain.problem):
        return max(judgement.view_scale.variance, judgement.point_scale.variance) > CONTRADICTED**2
    if judgement.view_scale.variance > CONTRADICTED**2:
        return True
    return plain.noise.noise.pixel_px > UNSUSPECTED_PX and "pixel_px" in plain.noise.estimated


def is_convincing(candidate: Consensus | None) -> TypeGuard[Consensus]:
    """Whether most views of a candidate agree, within the stated noise or within that of a plausible detector."""
    return (
        candidate is not None
        and _inlier_share(candidate) >= _CLEAR_SHARE
        and has_plausible_residuals(candidate.solution)
        and _is_within_noise(candidate)
    )


def _is_within_noise(candidate: Consensus) -> bool:
    """Whether the scatter of whole views is consistent with the noise in use."""
    return candidate.judgement.view_scale.variance <= CONTRADICTED**2


def _inlier_share(candidate: Consensus) -> float:
    is_inlier = np.concatenate(candidate.kept.views)
    return float(is_inlier.mean()) if len(is_inlier) else 0.0


def agreeing_samples(problem: Problem, states: Iterable[State]) -> tuple[int, ...]:
    """Numbers of the samples that one state explains far better than the rest, for the state that explains them best.

    Between the last of these samples and the first of the rest, the deviations in sigmas grow by a factor of at least
    five. The result is empty if no state has such a gap between 30 % and 80 % of the samples.
    """
    best: tuple[float, tuple[int, ...]] = (np.inf, ())
    numbers, sample_rows = np.unique(np.concatenate([g.sample for g in problem.groups]), return_inverse=True)
    for state in states:
        by_group = view_misfits(problem, state)
        sigmas = np.sqrt(np.concatenate([s.value / np.maximum(s.freedoms, 1) for s in by_group]))
        worst = np.zeros(len(numbers))  # view of each sample
        np.maximum.at(worst, sample_rows, sigmas)
        best = min(best, _split_at_gap(numbers, worst), key=lambda f: f[0])
    return best[1]


def _split_at_gap(numbers: IntArray, sigmas: Array) -> tuple[float, tuple[int, ...]]:
    """Largest deviation before the first clear gap of the sorted deviations, and the samples up to the gap."""
    order = np.argsort(sigmas, kind="stable")
    ordered = np.clip(sigmas[order], 1.0, _FARTHEST)
    first, last = int(np.ceil(_LEAST_SHARE * len(order))), int(_MOST_SHARE * len(order))
    gaps = np.flatnonzero(ordered[first : last + 1] > CLEAR_GAP * ordered[first - 1 : last])
    if not len(gaps):
        return np.inf, ()
    count = first + int(gaps[0])
    return float(ordered[count - 1]), tuple(sorted(int(n) for n in numbers[order[:count]]))
