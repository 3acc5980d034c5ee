"""How large a target would have to be: the reading with a factor to be found.

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

_DESCENT_STEPS = 25  # of a descent
_GAUSS_NEWTON_ROUNDS = 10  # of Gauss and Newton: from a size a third off six suffice
_LARGEST_STEP, _SETTLED_LOG = 0.3, 1e-5  # of the factor's logarithm
# By a smaller share of the squares no other size could predict so much better that it were named.
_WORTHWHILE = 0.25


def size_hypotheses(baseline: Reading, state: State) -> list[ConventionHypothesis]:
    """The size of each target that fits best, if the reading shows one, it fits better by some, and a size is stated.

    Args:
        baseline: As it was declared.
        state: Its fit.
    """
    seen = dict.fromkeys(group.target for group in baseline.problem.groups)
    names = [name for name in seen if not baseline.cell.targets[name].has_free_scale]
    factors = {name: _factor(baseline, name, state) for name in names}
    return [target_size(name, factor, baseline.cell) for name, factor in factors.items() if factor is not None]


def target_size(name: str, factor: float, cell: Cell) -> ConventionHypothesis:
    """A target `factor` times as large as stated, or so much further away than its observed poses say."""
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
    """The factor of least cost; None if another size gains too little, the target has none, or the solve fails."""
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
    """A step from the optimum of one size to another.

    Attributes:
        cost: Of the optimum.
        gain: What the other size gains of it, to second order.
        size: Logarithm of the factor between the two.
        state: The optimum.
    """

    cost: float
    gain: float
    size: float
    state: State


def _step(baseline: Reading, name: str, log: float, state: State) -> _Step:
    """The step by the score of a size, given by its logarithm, at its optimum."""
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
    """The factor by how far points in space are apart, over how far they should be; None if there are none."""
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
