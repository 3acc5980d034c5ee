"""Robust solution without outliers, and a description of each outlier.

The plain solution of all data is the result if it has no significant deviations. Otherwise, points that contradict the
rest of their view are excluded first. Subsets of the samples yield starts near the state of most views. From each
start, views and points are excluded or readmitted by the prediction of all others, until the inliers no longer change.
Source: docs/mathematics.md, "Outliers".
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Cell
from basecal.errors import BasecalError
from basecal.estimation.least_squares.studentized_residuals import judged_by_view, view_misfits
from basecal.estimation.outliers.classify import (
    Classification,
    classify_inliers,
    is_stated,
    view_scale,
)
from basecal.estimation.outliers.consensus import (
    Consensus,
    agreeing_samples,
    best_consensus,
    has_plausible_residuals,
    is_acceptable,
    is_convincing,
    may_hide_outliers,
)
from basecal.estimation.outliers.inlier_mask import (
    InlierMask,
    all_inliers,
    inlier_problem,
    without_points,
    without_unseen_stops,
)
from basecal.estimation.outliers.left_out import LeftOut, measure_left_out_items
from basecal.estimation.outliers.point_inliers import agreeing_points, readmit_points
from basecal.estimation.outliers.subset_starts import score, subset_states
from basecal.estimation.problem.correspondence import choose_correspondence
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import STATED, Settings
from basecal.estimation.solve import Solution, solve_from, solve_problem
from basecal.estimation.view.measurement import Noise
from basecal.estimation.view.pixels import PixelMeasurement

_SELECTION_ROUNDS = 12  # maximum number of rounds of selection
_FREE_ROUNDS = 6  # rounds with readmission; none afterwards, to avoid cycles


@dataclass(frozen=True, eq=False)
class RobustSolution:
    """Solution without outliers.

    Attributes:
        solution: Solution of the problem without the outliers.
        outliers: Excluded views and points, sorted by sample.
        left_out: Problem of the views that were excluded as a whole.
        samples: Number of samples, outliers included.
        points: Number of points in use.
        agreeing: Numbers of samples that agree with one another, if they are too few for a solution; else empty.
        consensus: Result of the search for outliers; None if nothing was excluded.
    """

    solution: Solution
    outliers: tuple[LeftOut, ...]
    left_out: Problem
    samples: int
    points: int
    agreeing: tuple[int, ...] = ()
    consensus: Consensus | None = None


def solve_robustly(
    problem: Problem, cell: Cell, settings: Settings = STATED, plain: Solution | None = None
) -> RobustSolution:
    """Detect gross outliers and solve without them.

    The solution is that of `solve_problem` if there are no outliers. It is the same if fewer than half of the views
    agree, since it is then unknown which views are correct.

    Args:
        problem: The problem with all views and points.
        cell: The cell.
        settings: Settings of the solver.
        plain: Solution of all views and points; None to compute it.

    Raises:
        NotObservable: if no view constrains the unknowns.
        InputError: if the cell contradicts the recording.
    """
    plain = plain or solve_problem(problem, cell, settings)
    all_items = all_inliers(plain.problem)
    judgement = classify_inliers(plain.problem, plain.state, all_items)
    agreeing: tuple[int, ...] = ()
    if not judgement.kept.same_as(all_items) or may_hide_outliers(plain, judgement):
        candidates, states = _find_candidates(plain, all_items, judgement, cell, settings)
        best = best_consensus([e for e in candidates if is_acceptable(e, plain)])
        if best is not None and not best.kept.same_as(all_items):
            return _make_result(cell, problem, best)
        agreeing = () if best is not None else agreeing_samples(plain.problem, states)
    no_views = plain.problem.with_groups(())
    return RobustSolution(plain, (), no_views, len(problem.samples), _point_count(problem), agreeing)


def judge_again(
    previous: RobustSolution, noisy: Solution, recorded_problem: Problem, cell: Cell, settings: Settings = STATED
) -> RobustSolution | None:
    """Detect outliers again with other sigmas, starting from previous inliers; None if no solution is accepted.

    Args:
        previous: Previous robust solution.
        noisy: Solution of the previous inliers, with the sigmas to use, which are held fixed.
        recorded_problem: The problem with all views and points, as recorded.
        cell: The cell.
        settings: Settings of the solver.
    """
    consensus = previous.consensus
    if consensus is None:
        return None
    candidate = _find_consensus(noisy.noise.hold_sigmas(consensus.problem), consensus.kept, noisy.state, settings)
    unobservable = consensus.solution.observability.unobservable
    is_accepted = (
        is_convincing(candidate)
        and candidate.solution.converged
        and candidate.solution.observability.unobservable <= unobservable
    )
    return _make_result(cell, recorded_problem, candidate) if candidate is not None and is_accepted else None


def leave_out_suspects(
    robust: RobustSolution, recorded_problem: Problem, cell: Cell, settings: Settings
) -> RobustSolution | None:
    """Exclude suspect views, whose deviations are large but not gross; None without any, or if no solution is accepted.

    A gross outlier increases the estimated noise and may thus be masked by it. Suspect views are therefore to be tested
    again with the noise of all others.

    Args:
        robust: Solution of all views.
        recorded_problem: The problem with all views and points, as recorded.
        cell: The cell.
        settings: Settings of the solver.
    """
    problem, state = robust.solution.problem, robust.solution.state
    all_items = all_inliers(problem)
    judgement = classify_inliers(problem, state, all_items)
    suspect = judgement.view_scale.suspect_scale()
    kept = replace(all_items, views=tuple(~suspect.gross_mask(squares) for squares in judgement.views))
    remaining = inlier_problem(problem, kept)
    if kept.same_as(all_items) or not _is_overdetermined(remaining):
        return None
    try:
        solution = solve_from(remaining, without_unseen_stops(remaining, state), settings)
    except (BasecalError, np.linalg.LinAlgError):
        return None
    candidate = Consensus(problem, kept, solution, judgement)
    return _make_result(cell, recorded_problem, candidate) if is_acceptable(candidate, robust.solution) else None


def _find_candidates(
    plain: Solution, full_mask: InlierMask, judgement: Classification, cell: Cell, settings: Settings
) -> tuple[list[Consensus], list[State]]:
    """Candidates from the plain state and, if it is not convincing, from subsets of samples; the latter's states."""
    full, kept, state = _drop_contradicted_points(plain, full_mask, judgement, cell, settings)
    candidates = [_find_consensus(full, kept, state, settings)]
    states: list[State] = []
    least_cost = np.inf
    for start in () if is_convincing(candidates[0]) else subset_states(without_points(full, kept.points), cell, state):
        cost = _cost(full, kept, start)
        if cost < least_cost:
            least_cost = cost
            states.append(start)
            candidates.append(_find_consensus(full, kept, start, settings))
            if is_convincing(candidates[-1]):
                break
    return [e for e in candidates if e is not None], states


def _cost(full: Problem, inliers: InlierMask, state: State) -> float:
    problem, reread = _reread_views(full, inliers, state)
    try:
        return score(without_points(problem, reread.points), state, is_stated(full))
    except np.linalg.LinAlgError:
        return np.inf


def _drop_contradicted_points(
    plain: Solution, full_mask: InlierMask, judgement: Classification, cell: Cell, settings: Settings
) -> tuple[Problem, InlierMask, State]:
    """Exclude points that contradict the rest of their view, and solve again if there are any.

    If the remaining points have no solution, all points are kept: the state that they were tested at was wrong.
    """
    suspects = []  # views with enough points, some of which contradict the others
    for group, points in zip(plain.problem.groups, judgement.points, strict=True):
        is_suspect = judgement.point_scale.gross_mask(points).any(-1) | may_hide_outliers(plain, judgement)
        suspects.append(np.flatnonzero(judged_by_view(group.measurement) & is_suspect))
    agreeing = agreeing_points(plain.problem, plain.state, suspects, cell)
    kept = InlierMask(full_mask.views, agreeing)
    if kept.same_as(full_mask) or not any(points.any() for points in agreeing):
        return plain.problem, full_mask, plain.state
    cleaned = without_points(plain.problem, agreeing).with_noise(Noise())
    try:
        solution = solve_from(cleaned, plain.state, settings)
        if not (solution.converged and has_plausible_residuals(solution)):
            solution = solve_problem(cleaned, cell, settings)
    except (BasecalError, np.linalg.LinAlgError):
        return plain.problem, full_mask, plain.state
    full, kept = _reread_views(plain.problem.with_noise(solution.noise.noise), kept, solution.state)
    return full, kept, solution.state


def _find_consensus(full: Problem, inliers: InlierMask, state: State, settings: Settings) -> Consensus | None:
    """Alternate between solution and classification until the inliers no longer change; None without a solution."""
    full, inliers = _reread_views(full, inliers, state)
    masked = without_points(full, inliers.points)
    try:
        squares = view_misfits(masked, state)
    except np.linalg.LinAlgError:
        return None
    scale = view_scale(masked, squares)
    inliers = InlierMask(tuple(~scale.gross_mask(s) for s in squares), inliers.points)
    earlier: list[InlierMask] = []
    may_readmit = True
    for k in range(_SELECTION_ROUNDS):
        remaining = inlier_problem(full, inliers)
        if not _is_overdetermined(remaining):
            return None
        try:
            solution = solve_from(remaining, without_unseen_stops(remaining, state), settings)
        except (BasecalError, np.linalg.LinAlgError):
            return None
        if not np.isfinite(solution.cost):
            return None
        full, inliers = _reread_views(full.with_noise(solution.noise.noise), inliers, solution.state)
        state = solution.state
        judgement = classify_inliers(full, state, inliers)
        # A repeated selection means a cycle; views are then only excluded.
        may_readmit &= k < _FREE_ROUNDS and not any(map(judgement.kept.same_as, earlier))
        selected = judgement.kept if may_readmit else judgement.kept.intersection(inliers)
        if may_readmit and selected.same_as(inliers):
            selected = readmit_points(full, state, inliers, judgement.point_scale)
        if selected.same_as(inliers):
            break
        earlier.append(inliers)
        inliers = selected
    return Consensus(full, inliers, solution, judgement)


def _is_overdetermined(problem: Problem) -> bool:
    """Whether there are more equations than unknowns."""
    return problem.equation_count > problem.width


def _reread_views(full: Problem, inliers: InlierMask, state: State) -> tuple[Problem, InlierMask]:
    """Choose the correspondence of each view that the state predicts best, and reorder the point masks accordingly."""
    reread, changed = choose_correspondence(full, state)
    if not changed:
        return full, inliers
    points = list(inliers.points)
    for k, (old, new) in enumerate(zip(full.groups, reread.groups, strict=True)):
        if new.half_turn is not None:
            assert isinstance(old.measurement, PixelMeasurement)
            assert isinstance(new.measurement, PixelMeasurement)
            is_reversed = np.any(old.measurement.pixels != new.measurement.pixels, axis=(1, 2))
            points[k] = np.where(is_reversed[:, None], points[k][:, ::-1], points[k])
    return reread, replace(inliers, points=tuple(points))


def _make_result(cell: Cell, problem: Problem, consensus: Consensus) -> RobustSolution:
    rows = [np.flatnonzero(~v) for v in consensus.kept.views]
    groups = (replace(g, readings=()).take(r) for g, r in zip(consensus.problem.groups, rows, strict=True) if len(r))
    outliers = measure_left_out_items(
        cell, problem, consensus.problem, consensus.solution.state, consensus.kept, consensus.judgement
    )
    left_out = consensus.problem.with_groups(groups)
    points = _point_count(consensus.solution.problem)
    return RobustSolution(consensus.solution, outliers, left_out, len(problem.samples), points, consensus=consensus)


def _point_count(problem: Problem) -> int:
    return sum(int(group.measurement.point_counts().sum()) for group in problem.groups)
