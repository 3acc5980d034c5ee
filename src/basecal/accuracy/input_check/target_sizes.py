"""Hypotheses about the size of a target, by an unknown factor.

`benchmarks.mutations` judges its limits.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.accuracy.input_check.hypotheses import ConventionHypothesis, scale_translations
from basecal.accuracy.phrases.target_length import as_written
from basecal.accuracy.readings.reading import Reading
from basecal.accuracy.systematic_errors.score_tests import score
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Cell
from basecal.effects import target_size as effect
from basecal.errors import BasecalError
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.problem.problem import State
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import Array

_DESCENT_STEPS = 25  # iterations of a descent
_GAUSS_NEWTON_ROUNDS = 10  # Gauss-Newton iterations: six suffice for an initial error of a third
_LARGEST_STEP, _SETTLED_LOG = 0.3, 1e-5  # steps of the logarithm of the factor
# Share of the cost that another size has to gain: with less, its predictions cannot improve enough to be reported.
_WORTHWHILE = 0.25


def size_hypotheses(baseline: Reading, state: State) -> list[ConventionHypothesis]:
    """Hypotheses of the best-fitting size of each target, if a size is stated and another fits noticeably better.

    Args:
        baseline: The declared reading.
        state: Fitted state of the declared reading.
    """
    seen = dict.fromkeys(group.target for group in baseline.problem.groups)
    names = [name for name in seen if not baseline.cell.targets[name].has_free_scale]
    factors = {name: _factor(baseline, name, state) for name in names}
    return [target_size(name, factor, baseline.cell) for name, factor in factors.items() if factor is not None]


def target_size(name: str, factor: float, cell: Cell) -> ConventionHypothesis:
    """Hypothesis that a target, or the distances of its observed poses, are `factor` times as large as stated."""
    words = f"{name} is {factor:.4g} times as large as stated"
    if len(cell.robots) == 1:  # whose lengths by the inverse factor fit as well
        words += f", or poses of {next(iter(cell.robots))} are {factor:.4g} times as long as they are"
    return ConventionHypothesis(
        "board-size",
        (name,),
        words,
        f"measure {name} and state its true size{as_written(cell, name, factor)}",
        "",
        lambda reading: _resize(reading, name, factor),
        nested=True,
    )


def _resize(reading: Reading, name: str, factor: float) -> Reading:
    return reading.resize({name: factor}).with_target_poses(scale_translations(factor), name)


def _factor(baseline: Reading, name: str, state: State) -> float | None:
    """The factor of least cost; None if the gain is too small, the target has no size, or the solve fails."""
    try:
        first = _step(baseline, name, 0.0, state)
        by_spread = _spread_factor(baseline, name)
        if by_spread is not None:
            cost = _step(baseline, name, float(np.log(by_spread)), first.state).cost
            return by_spread if cost < (1 - _WORTHWHILE) * first.cost else None
        if first.gain < _WORTHWHILE * first.cost:
            return None
        log, step = 0.0, first
        for _ in range(_GAUSS_NEWTON_ROUNDS):
            log += step.size
            step = _step(baseline, name, log, step.state)
            if abs(step.size) < _SETTLED_LOG:
                break
    except (BasecalError, np.linalg.LinAlgError):
        return None
    return float(np.exp(log))


class _Step(NamedTuple):
    """A step from one size to a better one.

    Attributes:
        cost: Cost of the optimum at the current size.
        gain: Reduction of the cost by the step, to second order.
        size: Logarithm of the factor between the two sizes.
        state: State of the optimum at the current size.
    """

    cost: float
    gain: float
    size: float
    state: State


def _step(baseline: Reading, name: str, log: float, state: State) -> _Step:
    """Score step of the size at its optimum; `log` is the logarithm of the current factor."""
    problem = _resize(baseline, name, float(np.exp(log))).problem
    start = replace(state, stop_errors=np.zeros((len(problem.stops), 6)))
    optimum = bundle_adjust(problem, start, 1, _DESCENT_STEPS)
    situation = Situation(problem, optimum.state, problem, {})
    candidate = next((each for each in effect.candidates(situation) if each.about == (name,)), None)
    if candidate is None:
        return _Step(optimum.cost, 0.0, 0.0, optimum.state)
    found = score(situation.linearisation, candidate)
    size = -float(np.log1p(-min(float(found.size[0, 0]), 0.5)))
    return _Step(
        optimum.cost, float(found.statistic[0]), float(np.clip(size, -_LARGEST_STEP, _LARGEST_STEP)), optimum.state
    )


def _spread_factor(baseline: Reading, name: str) -> float | None:
    """Factor from the observed spread of 3-D points over their stated spread; None if there are no 3-D points."""
    seen = [g.measurement for g in baseline.problem.groups if g.target == name]
    ratios = [
        _spread(points[is_seen]) / _spread(of.points_in_target[is_seen])
        for of in seen
        if isinstance(of, PointMeasurement)
        for is_seen, points in zip(of.seen, of.points_in_camera, strict=True)
        if is_seen.sum() > 1
    ]
    return float(np.median(ratios)) if ratios else None


def _spread(points: Array) -> float:
    return float(np.sqrt(np.sum(points.var(0))))
