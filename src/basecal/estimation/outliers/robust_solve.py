"""The solution of what agrees, and what does not, each with its reason.

The plain solution first: where nothing in it is beyond chance, that is the answer. Else points that the rest of their
view contradicts are left out. Subsets of the samples find the state of most views. All others predict each view and
each point, which are left out and taken back until none changes sides. Source: docs/mathematics.md, "Outliers".
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Cell
from basecal.errors import BasecalError
from basecal.estimation.least_squares.studentized_residuals import judged_by_view, studentize_views
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
    convincing,
    fits,
    implausible,
    is_answer,
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

_SELECTION_ROUNDS = 12  # of leaving out and taking back, at most
_FREE_ROUNDS = 6  # after these nothing is taken back: no circle


@dataclass(frozen=True, eq=False)
class RobustSolution:
    """The solution of what agrees.

    Attributes:
        solution: Of the problem without the outliers.
        outliers: What was left out, by sample.
        left_out: The views that were left out whole, as a problem of their own at the same state.
        samples: How many samples were seen.
        points: How many points are used.
        agreeing: Numbers of the samples that alone agree with one another, where they are too few to go by.
        consensus: Where the search for outliers came to rest; None where nothing was left out.
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
    """The solution of all views and points but the gross outliers, and these.

    Where there are none it is that of `solve_problem`. Where fewer than half of the samples agree it is that, too:
    then no part of the data is known to be the right one.

    Args:
        problem: What was seen.
        cell: What exists and what is known.
        settings: How to solve.
        plain: The solution of all views and points, where it is known already.

    Raises:
        NotObservable: if nothing was seen that could be solved for.
        InputError: if the cell contradicts the recording.
    """
    plain = plain or solve_problem(problem, cell, settings)
    whole = all_inliers(plain.problem)
    judgement = classify_inliers(plain.problem, plain.state, whole)
    agreeing: tuple[int, ...] = ()
    if not judgement.kept.same_as(whole) or implausible(plain, judgement):
        # States far from the truth meet points at the camera's centre; what overflows there is left out by its cost.
        with np.errstate(all="ignore"):
            ends, states = _find_candidates(plain, whole, judgement, cell, settings)
        best = best_consensus([e for e in ends if is_answer(e, plain)])
        if best is not None and not best.kept.same_as(whole):
            return _make_result(cell, problem, best)
        agreeing = () if best is not None else agreeing_samples(plain.problem, states)
    nothing = plain.problem.with_groups(())
    return RobustSolution(plain, (), nothing, _sample_count(problem), _point_count(problem), agreeing)


def judge_again(
    previous: RobustSolution, noisy: Solution, recorded_problem: Problem, cell: Cell, settings: Settings = STATED
) -> RobustSolution | None:
    """The views and points judged anew by other sigmas; None if that leads to no answer.

    Args:
        previous: What was left out so far.
        noisy: The solution of what is left, with the sigmas to judge by, which are held.
        recorded_problem: All that was seen, as it was recorded.
        cell: What exists and what is known.
        settings: How to solve.
    """
    rest = previous.consensus
    if rest is None:
        return None
    with np.errstate(all="ignore"):
        end = _find_consensus(noisy.noise.hold_sigmas(rest.problem), rest.kept, noisy.state, settings)
    sees = rest.solution.observability.unobservable
    convinces = convincing(end) and end.solution.converged and end.solution.observability.unobservable <= sees
    return _make_result(cell, recorded_problem, end) if end is not None and convinces else None


def leave_out_suspects(
    robust: RobustSolution, recorded_problem: Problem, cell: Cell, settings: Settings = STATED
) -> RobustSolution | None:
    """Leave out views that stand out, though none is gross; None if none does or no answer is left.

    A gross view enlarges the noise that is estimated with it, and hides behind it. The views that stand out are to be
    judged once more, by the noise of all others.

    Args:
        robust: The solution of all views.
        recorded_problem: All that was seen, as it was recorded.
        cell: What exists and what is known.
        settings: How to solve.
    """
    problem, state = robust.solution.problem, robust.solution.state
    every = all_inliers(problem)
    judgement = classify_inliers(problem, state, every)
    suspect = judgement.view_scale.suspect_scale()
    kept = replace(every, views=tuple(~suspect.gross_mask(squares) for squares in judgement.views))
    left = inlier_problem(problem, kept)
    if kept.same_as(every) or not _is_overdetermined(left):
        return None
    try:
        solution = solve_from(left, without_unseen_stops(left, state), settings)
    except (BasecalError, np.linalg.LinAlgError):
        return None
    end = Consensus(problem, kept, solution, judgement)
    return _make_result(cell, recorded_problem, end) if is_answer(end, robust.solution) else None


def _find_candidates(
    plain: Solution, full_mask: InlierMask, judgement: Classification, cell: Cell, settings: Settings
) -> tuple[list[Consensus], list[State]]:
    """Where the plain state leads and, where that does not convince, where subsets of the samples do; these states."""
    full, kept, state = _drop_contradicted_points(plain, full_mask, judgement, cell, settings)
    ends = [_find_consensus(full, kept, state, settings)]
    states: list[State] = []
    least = np.inf
    for start in () if convincing(ends[0]) else subset_states(without_points(full, kept.points), cell, state):
        cost = _cost(full, kept, start)
        if cost < least:
            least = cost
            states.append(start)
            ends.append(_find_consensus(full, kept, start, settings))
            if convincing(ends[-1]):
                break
    return [e for e in ends if e is not None], states


def _cost(full: Problem, inliers: InlierMask, state: State) -> float:
    problem, now = _reread_views(full, inliers, state)
    try:
        return score(without_points(problem, now.points), state, is_stated(full))
    except np.linalg.LinAlgError:
        return np.inf


def _drop_contradicted_points(
    plain: Solution, full_mask: InlierMask, judgement: Classification, cell: Cell, settings: Settings
) -> tuple[Problem, InlierMask, State]:
    """Without the points that the rest of their view contradicts, and solved again where there are any.

    Where what is left has no solution, the state was wrong that called them contradicted.
    """
    suspects = []  # views of many points of which some are not where the others put them
    for group, points in zip(plain.problem.groups, judgement.points, strict=True):
        beyond = judgement.point_scale.gross_mask(points).any(-1) | implausible(plain, judgement)
        suspects.append(np.flatnonzero(judged_by_view(group.measurement) & beyond))
    within = agreeing_points(plain.problem, plain.state, suspects, cell)
    kept = InlierMask(full_mask.views, within)
    if kept.same_as(full_mask) or not any(points.any() for points in within):
        return plain.problem, full_mask, plain.state
    cleaned = without_points(plain.problem, within).with_noise(Noise())
    try:
        again = solve_from(cleaned, plain.state, settings)
        if not (again.converged and fits(again)):
            again = solve_problem(cleaned, cell, settings)
    except (BasecalError, np.linalg.LinAlgError):
        return plain.problem, full_mask, plain.state
    full, kept = _reread_views(plain.problem.with_noise(again.noise.noise), kept, again.state)
    return full, kept, again.state


def _find_consensus(full: Problem, inliers: InlierMask, state: State, settings: Settings) -> Consensus | None:
    """Descend from a state until no view or point changes sides; None if that is no answer."""
    full, inliers = _reread_views(full, inliers, state)
    masked = without_points(full, inliers.points)
    try:
        squares = studentize_views(masked, state)
    except np.linalg.LinAlgError:
        return None
    scale = view_scale(masked, squares)
    inliers = InlierMask(tuple(~scale.gross_mask(s) for s in squares), inliers.points)
    before: list[InlierMask] = []
    free = True
    for k in range(_SELECTION_ROUNDS):
        left = inlier_problem(full, inliers)
        if not _is_overdetermined(left):
            return None
        try:
            solution = solve_from(left, without_unseen_stops(left, state), settings)
        except (BasecalError, np.linalg.LinAlgError):
            return None
        if not np.isfinite(solution.cost):
            return None
        full, inliers = _reread_views(full.with_noise(solution.noise.noise), inliers, solution.state)
        state = solution.state
        judgement = classify_inliers(full, state, inliers)
        # What was kept before comes again: a view goes and is taken back in turns, and is left out.
        free &= k < _FREE_ROUNDS and not any(map(judgement.kept.same_as, before))
        now = judgement.kept if free else judgement.kept.intersection(inliers)
        if free and now.same_as(inliers):
            now = readmit_points(full, state, inliers, judgement.point_scale)
        if now.same_as(inliers):
            break
        before.append(inliers)
        inliers = now
    return Consensus(full, inliers, solution, judgement)


def _is_overdetermined(problem: Problem) -> bool:
    """Whether there are more equations than unknowns."""
    return sum(int(group.measurement.equations().sum()) for group in problem.groups) > problem.width


def _reread_views(full: Problem, inliers: InlierMask, state: State) -> tuple[Problem, InlierMask]:
    """Every view read as the state predicts best; of a grid read from its other end the points change places, too."""
    after, changed = choose_correspondence(full, state)
    if not changed:
        return full, inliers
    points = list(inliers.points)
    for k, (old, new) in enumerate(zip(full.groups, after.groups, strict=True)):
        if new.half_turn is not None:
            assert isinstance(old.measurement, PixelMeasurement)
            assert isinstance(new.measurement, PixelMeasurement)
            turned = np.any(old.measurement.pixels != new.measurement.pixels, axis=(1, 2))
            points[k] = np.where(turned[:, None], points[k][:, ::-1], points[k])
    return after, replace(inliers, points=tuple(points))


def _make_result(cell: Cell, problem: Problem, end: Consensus) -> RobustSolution:
    rows = [np.flatnonzero(~v) for v in end.kept.views]
    groups = (replace(g, readings=()).take(r) for g, r in zip(end.problem.groups, rows, strict=True) if len(r))
    found = measure_left_out_items(cell, problem, end.problem, end.solution.state, end.kept, end.judgement)
    left_out = end.problem.with_groups(groups)
    points = _point_count(end.solution.problem)
    return RobustSolution(end.solution, found, left_out, _sample_count(problem), points, consensus=end)


def _sample_count(problem: Problem) -> int:
    return len({int(number) for group in problem.groups for number in group.sample})


def _point_count(problem: Problem) -> int:
    return sum(int(group.measurement.point_counts().sum()) for group in problem.groups)
