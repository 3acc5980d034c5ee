"""Whether the data call for noise of robots that state none, and how much.

Against "no noise of robots" stands one pair of sigmas for all that state none, and against that a pair for each; the
ratio of likelihoods decides. A sigma that is zero lies on the border of what can be, so that twice the log ratio is
a mixture of chi-squares, here bounded by halves of one and of two degrees of freedom. Source: Self & Liang 1987.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2

from basecal.cell import Finding
from basecal.estimation.least_squares.bundle_adjustment import Optimum, bundle_adjust
from basecal.estimation.noise.estimate import NoiseEstimate, birge_ratio, degrees_of_freedom
from basecal.estimation.noise.marginal_likelihood import (
    MarginalLikelihood,
    VarianceComponents,
    VarianceModel,
    marginal_likelihood,
    most_likely,
    promising,
)
from basecal.estimation.noise.robot_noise import stops_made, with_robot_noise, without_errors
from basecal.estimation.problem.problem import Problem
from basecal.geometry import Array

CHANCE = 1e-3
_CHANCE_APART = 1e-2
_FEWEST_STOPS = 8
_INSEPARABLE = 6.0
_FEW_PIXELS = 0.2
_ROUNDS = 6
_SETTLED = 1e-3
_EXACT = 1e-9


def threshold(chance: float = CHANCE) -> float:
    """Twice the log ratio of likelihoods that a pair of sigmas exceeds by this chance where both are zero."""
    return float(brentq(lambda t: 0.5 * chi2.sf(t, 1) + 0.5 * chi2.sf(t, 2) - chance, 0.0, 100.0))


@dataclass(frozen=True, eq=False)
class _Weighing:
    """What the data say of three explanations: the views' noise alone, that times a factor, and robots' noise."""

    plain: VarianceComponents
    scaled: VarianceComponents | None
    robots: VarianceComponents | None

    @property
    def called_for(self) -> bool:
        """Whether chance in the views' noise explains the residuals no more."""
        return self.robots is not None and self.plain.surprise - self.robots.surprise > threshold()

    @property
    def by_factor(self) -> float:
        """How much more surprising the data are by a factor than by robots' noise."""
        if self.robots is None:
            return -np.inf
        return np.inf if self.scaled is None else self.scaled.surprise - self.robots.surprise


def estimate_robot_noise(
    problem: Problem, end: Optimum, noise: NoiseEstimate, iterations: int
) -> tuple[Problem, Optimum, NoiseEstimate, list[Finding]]:
    """The problem and its optimum with noise of the robots that state none, where the data call for it.

    Args:
        problem: The problem with the noise in use.
        end: Its optimum.
        noise: That noise.
        iterations: Steps of a descent, at most.
    """
    robots = sorted(name for name in problem.unstated if stops_made(problem, name))
    moving = [name for name in robots if stops_made(problem, name) > 1]
    still = [name for name in robots if name not in moving]
    exact = any(getattr(noise.noise, name) < _EXACT for name in noise.estimated)
    if not moving or not end.converged or exact or degrees_of_freedom(problem) < 1:
        return problem, end, noise, _still_told(still, ())
    fields = VarianceModel(noise.estimated)
    evidence = marginal_likelihood(problem, end.state, noise.noise)
    of = _weighed(evidence, fields, tuple(robots))
    if of.robots is not None and of.called_for and of.by_factor > _INSEPARABLE:
        model = _apart(evidence, of.robots, tuple(moving), len(still))
        problem, end, noise = _settled(problem, end, noise, model, iterations)
        return problem, end, noise, _still_told(still, moving)
    if of.scaled is not None and of.by_factor > -_INSEPARABLE:
        factor = max(of.scaled.sigmas.factor, noise.factor)
        return problem, end, replace(noise, factor=factor), [_inseparable(robots), *_still_told(still, ())]
    alike = not of.called_for and bool(fields.fields) and _as_well_by_robots(evidence, of.plain, tuple(robots))
    return problem, end, noise, [_inseparable(robots)] * alike + _still_told(still, ())


def _weighed(evidence: MarginalLikelihood, fields: VarianceModel, pool: tuple[str, ...]) -> _Weighing:
    logs = np.log([getattr(evidence.noise, name) for name in fields.fields])
    plain = most_likely(evidence, fields, logs)
    if not promising(evidence, plain, pool):
        return _Weighing(plain, None, None)
    robots = most_likely(evidence, replace(fields, pools=(pool,)), np.concatenate([plain.logs, np.full(2, np.nan)]))
    of = _Weighing(plain, None, robots)
    if fields.fields or not of.called_for:
        return of
    return replace(of, scaled=most_likely(evidence, VarianceModel(factored=True), np.zeros(1)))


def _as_well_by_robots(evidence: MarginalLikelihood, plain: VarianceComponents, pool: tuple[str, ...]) -> bool:
    """Whether the robots could be the source of nearly all that was taken for noise of the views."""
    noise = plain.sigmas.noise
    few = noise._replace(**{name: _FEW_PIXELS * getattr(noise, name) for name in plain.model.fields})
    alone = most_likely(replace(evidence, noise=few), VarianceModel(pools=(pool,)), np.full(2, np.nan))
    return alone.surprise - plain.surprise < _INSEPARABLE


def _apart(
    evidence: MarginalLikelihood, alike: VarianceComponents, moving: tuple[str, ...], still: int
) -> VarianceComponents:
    """Sigmas for each robot, where all made enough stops and the data tell them apart; else the common pair."""
    enough = all(stops_made(evidence.problem, name) >= _FEWEST_STOPS for name in moving)
    if len(moving) < 2 or still or not enough:
        return alike
    model = replace(alike.model, pools=tuple((name,) for name in moving))
    count = len(model.fields)
    pair = alike.logs[alike.model.robots]
    apart = most_likely(evidence, model, np.concatenate([alike.logs[:count], np.tile(pair, len(moving))]))
    needed = float(chi2.isf(_CHANCE_APART, 2 * (len(moving) - 1)))
    return apart if alike.surprise - apart.surprise > needed else alike


def _settled(
    problem: Problem, end: Optimum, noise: NoiseEstimate, found: VarianceComponents, iterations: int
) -> tuple[Problem, Optimum, NoiseEstimate]:
    """The optimum with sigmas found about it, and these sigmas."""
    dof = degrees_of_freedom(problem)
    for _ in range(_ROUNDS):
        sigmas = found.sigmas
        problem = with_robot_noise(problem.with_noise(sigmas.noise), sigmas.robots)
        end = bundle_adjust(problem, without_errors(problem, end.state), dof, iterations)
        after = most_likely(marginal_likelihood(problem, end.state, sigmas.noise), found.model, found.logs)
        change = _change(found.logs, after.logs)
        if change < _SETTLED:
            break
        found = after
    factor = 1.0 if noise.estimated else birge_ratio(end.cost, dof)
    settled = change < _SETTLED and end.converged
    return problem, end, NoiseEstimate(sigmas.noise, factor, noise.estimated, settled, sigmas.robots)


def _change(before: Array, after: Array) -> float:
    """The largest change of a sigma, as a share of the largest of its kind."""
    return float(np.abs(np.exp(after - np.maximum(before, after)) - np.exp(before - np.maximum(before, after))).max())


def _inseparable(robots: list[str]) -> Finding:
    names = " and ".join(robots)
    message = (
        f"noise of {names} explains the residuals as well as noise of the camera's measurements does, so that one "
        "common factor is estimated: state the noise of these robots, or that of the measurements"
    )
    return Finding("noise-not-identifiable", "info", tuple(robots), message)


def _still_told(still: list[str], others: tuple[str, ...] | list[str]) -> list[Finding]:
    """What cannot be known of robots that made one stop: their error is one with their base's place."""
    told = []
    for name in still:
        then = (
            f"it is taken to be as noisy as {' and '.join(others)}"
            if others
            else "the covariance does not hold it: state the robot's noise, or move it"
        )
        message = f"{name} made a single stop, where an error of its recorded pose shows in no residual; {then}"
        told.append(Finding("noise-not-identifiable", "info", (name,), message))
    return told
