"""Hypotheses about the size of a target, by an unknown factor.

`benchmarks.mutations` judges its limits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.accuracy.input_check.hypotheses import ConventionHypothesis, scale_translations
from basecal.accuracy.phrases.target_length import corrected_length_clause
from basecal.accuracy.readings.reading import Reading
from basecal.accuracy.systematic_errors.score_tests import score
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Cell
from basecal.effects import target_size as effect
from basecal.errors import BasecalError
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.problem.problem import State
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import Array

_DESCENT_STEPS = 25  # iterations of a descent
_GAUSS_NEWTON_ROUNDS = 10  # Gauss-Newton iterations: six suffice for an initial error of a third
_LARGEST_LOG, _CONVERGED_LOG = 0.3, 1e-5  # steps of the logarithm of the factor
# Share of the cost that another size has to gain: with less, its predictions cannot improve enough to be reported.
_WORTHWHILE_SHARE = 0.25


def size_hypotheses(baseline: Reading, state: State) -> list[ConventionHypothesis]:
    """Hypotheses of the best-fitting size of each target, if a size is stated and another fits noticeably better.

    Args:
        baseline: The declared reading.
        state: Fitted state of the declared reading.
    """
    seen = dict.fromkeys(group.target for group in baseline.problem.groups)
    names = [name for name in seen if not baseline.cell.targets[name].has_free_scale]
    factors = {name: _best_factor(baseline, name, state) for name in names}
    return [size_hypothesis(name, factor, baseline.cell) for name, factor in factors.items() if factor is not None]


def size_hypothesis(name: str, factor: float, cell: Cell) -> ConventionHypothesis:
    """Hypothesis that a target, or the distances of its observed poses, are `factor` times as large as stated."""
    words = f"{name} is {factor:.4g} times as large as stated"
    if len(cell.robots) == 1:  # whose lengths by the inverse factor fit as well
        words += f", or poses of {next(iter(cell.robots))} are {factor:.4g} times as long as they are"
    return ConventionHypothesis(
        "board-size",
        (name,),
        words,
        f"measure {name} and state its true size{corrected_length_clause(cell, name, factor)}",
        "",
        lambda reading: _resize(reading, name, factor),
        is_wider=True,
    )


def _resize(reading: Reading, name: str, factor: float) -> Reading:
    return reading.resize({name: factor}).with_target_poses(scale_translations(factor), name)


def _best_factor(baseline: Reading, name: str, state: State) -> float | None:
    """The factor of least cost; None if the gain is too small, the target has no size, or the solve fails."""
    try:
        first = _step(baseline, name, 0.0, state)
        spread_factor = _spread_factor(baseline, name)
        if spread_factor is not None:
            cost = _step(baseline, name, float(np.log(spread_factor)), first.state).cost
            return spread_factor if cost < (1 - _WORTHWHILE_SHARE) * first.cost else None
        if first.gain < _WORTHWHILE_SHARE * first.cost:
            return None
        log_factor, step = 0.0, first
        for _ in range(_GAUSS_NEWTON_ROUNDS):
            log_factor += step.log_ratio
            step = _step(baseline, name, log_factor, step.state)
            if abs(step.log_ratio) < _CONVERGED_LOG:
                break
    except (BasecalError, np.linalg.LinAlgError):
        return None
    return float(np.exp(log_factor))


class _Step(NamedTuple):
    """A step from one size to a better one.

    Attributes:
        cost: Cost of the optimum at the current size.
        gain: Reduction of the cost by the step, to second order.
        log_ratio: Logarithm of the better size over the current one.
        state: State of the optimum at the current size.
    """

    cost: float
    gain: float
    log_ratio: float
    state: State


def _step(baseline: Reading, name: str, log_factor: float, state: State) -> _Step:
    """Score step of the size at the optimum for the current one; `log_factor` is its logarithm over the stated one."""
    problem = _resize(baseline, name, float(np.exp(log_factor))).problem
    optimum = bundle_adjust(problem, without_errors(problem, state), 1, _DESCENT_STEPS)
    situation = Situation(problem, optimum.state, problem, {})
    candidate = next((each for each in effect.candidates(situation) if each.about == (name,)), None)
    if candidate is None:
        return _Step(optimum.cost, 0.0, 0.0, optimum.state)
    found = score(situation.linearisation, candidate)
    log_ratio = float(np.clip(-np.log1p(-min(float(found.size[0, 0]), 0.5)), -_LARGEST_LOG, _LARGEST_LOG))
    return _Step(optimum.cost, float(found.statistic[0]), log_ratio, optimum.state)


def _spread_factor(baseline: Reading, name: str) -> float | None:
    """Factor from the observed spread of 3-D points over their stated spread; None if there are no 3-D points."""
    measurements = [g.measurement for g in baseline.problem.groups if g.target == name]
    ratios = [
        _spread(points[is_seen]) / _spread(views.points_in_target[is_seen])
        for views in measurements
        if isinstance(views, PointMeasurement)
        for is_seen, points in zip(views.seen, views.points_in_camera, strict=True)
        if is_seen.sum() > 1
    ]
    return float(np.median(ratios)) if ratios else None


def _spread(points: Array) -> float:
    return float(np.sqrt(np.sum(points.var(0))))
