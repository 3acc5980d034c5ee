"""Sigmas by the marginal likelihood of the data, everything else integrated out.

With cost the sum of squares over sigmas at the optimum, stop errors and priors among them, and n_f the residuals that
go by sigma_f, minus twice the logarithm is, but for a constant,

    cost + log det(information of the stop errors) + log det(information of the unknowns) + sum n_f log sigma_f^2

Source: Patterson & Thompson 1971 (restricted likelihood), Harville 1977; docs/mathematics.md (5.2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from basecal.estimation.least_squares.bundle_adjustment import Optimum, bundle_adjust
from basecal.estimation.least_squares.normal_equations import NormalEquations, linearise
from basecal.estimation.noise.compressed_views import STATED, CompressedMeasurement, compressed
from basecal.estimation.noise.robot_noise import with_robot_noise, without_errors
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.view.measurement import Noise
from basecal.geometry import Array

LARGEST = (0.1, 0.3)
SMALLEST = (1e-7, 3e-7)
_GRID = (1e-3, 1e-2, 1e-1)
_SHARE = (1.0, 0.3, 0.1)
_STEP = 1e-3
_CURVED = 0.05
_FLAT = 1e-2
_FLOOR = 1e-12
_FACTOR = 1e3
_TIGHT = 1e-8
_LITTLE = tuple(np.log([1e-5, 2e-5]))
UNIT = Noise()


@dataclass(frozen=True)
class VarianceModel:
    """Which sigmas are looked for.

    Attributes:
        fields: Fields of `Noise`.
        pools: Robots that share one pair of sigmas (translation [m], rotation [rad]), pool by pool.
        factored: Whether stated variances of views have a common factor.
    """

    fields: tuple[str, ...] = ()
    pools: tuple[tuple[str, ...], ...] = ()
    factored: bool = False

    @property
    def robots(self) -> slice:
        """Where the logarithms of the pools' sigmas stand."""
        return slice(len(self.fields), len(self.fields) + 2 * len(self.pools))


@dataclass(frozen=True, eq=False)
class Sigmas:
    """Values for what a model looks for; `robots` by name, (6,) [m, rad]; the factor is of stated variances."""

    noise: Noise
    robots: Mapping[str, Array]
    factor: float


@dataclass(frozen=True, eq=False)
class VarianceComponents:
    """The most likely sigmas of a model.

    Attributes:
        model: What was looked for.
        logs: (k,) their logarithms: fields, then each pool's pair, then the root of the factor.
        surprise: Minus twice the logarithm of the marginal likelihood, but for a constant that all models share.
    """

    model: VarianceModel
    logs: Array
    surprise: float

    @property
    def sigmas(self) -> Sigmas:
        """The sigmas by name."""
        return sigmas_of(self.model, self.logs, UNIT)


@dataclass(frozen=True, eq=False)
class MarginalLikelihood:
    """A problem to second order about a state, to try sigmas on; see `marginal_likelihood`.

    Attributes:
        problem: Its views compressed.
        state: Where.
        counts: Scalar residuals by field of `Noise`, and `stated`.
        noise: Sigmas of the fields that are not looked for.
        floor: (p, p) what keeps directions regular that are not seen, the same for all sigmas.
    """

    problem: Problem
    state: State
    counts: Mapping[str, int]
    noise: Noise
    floor: Array


def marginal_likelihood(problem: Problem, state: State, noise: Noise = UNIT) -> MarginalLikelihood:
    """The evidence about a state; with sigmas for what states none, where a model does not look for them."""
    counts: dict[str, int] = {}
    for group in problem.groups:
        for key, count in group.measurement.counts().items():
            counts[key] = counts.get(key, 0) + count
    small = compressed(problem, state)
    diagonal = np.diag(linearise(small, state).hessian)
    return MarginalLikelihood(small, state, counts, noise, np.diag(_FLOOR * diagonal + 1e-300))


def sigmas_of(model: VarianceModel, logs: Array, noise: Noise) -> Sigmas:
    """The sigmas whose logarithms these are, (k,), beside those of the fields that the model does not look for."""
    values = np.exp(logs)
    noise = noise._replace(**{name: float(v) for name, v in zip(model.fields, values, strict=False)})
    pairs = values[model.robots].reshape(-1, 2)
    robots = {name: np.repeat(pair, 3) for pool, pair in zip(model.pools, pairs, strict=True) for name in pool}
    return Sigmas(noise, robots, float(values[-1] ** 2) if model.factored else 1.0)


def neg2_log_likelihood(evidence: MarginalLikelihood, model: VarianceModel, logs: Array) -> float:
    """Minus twice the log marginal likelihood at these logarithms of sigmas, (k,)."""
    _, end = _optimum(evidence, model, logs)
    return _surprise(evidence, model, logs, end.normal)


def neg2_log_likelihood_slope(evidence: MarginalLikelihood, model: VarianceModel, logs: Array) -> tuple[float, Array]:
    """The same, and its derivative to the logarithms, (k,).

    That of the cost at its optimum is that of its terms; that of the log determinants is a difference.
    """
    problem, end = _optimum(evidence, model, logs)
    slope = 2 * (_weighed(evidence, model) - _squares(model, problem, end.state))
    log_det = _log_det(evidence, end.normal)
    for k, step in enumerate(_STEP * np.eye(len(logs))):
        slope[k] += (_log_det(evidence, _at(evidence, model, problem, end.state, logs + step)) - log_det) / _STEP
    return _surprise(evidence, model, logs, end.normal), slope


def information_of(evidence: MarginalLikelihood, model: VarianceModel, logs: Array) -> Array:
    """Information of the unknowns at these logarithms of sigmas, (p, p), the stops' errors eliminated."""
    _, end = _optimum(evidence, model, logs)
    return end.normal.hessian + evidence.floor


def _optimum(evidence: MarginalLikelihood, model: VarianceModel, logs: Array) -> tuple[Problem, Optimum]:
    problem = _with(evidence, sigmas_of(model, logs, evidence.noise))
    start = without_errors(problem, evidence.state)
    return problem, bundle_adjust(problem, start, sum(evidence.counts.values()))


def _surprise(evidence: MarginalLikelihood, model: VarianceModel, logs: Array, normal: NormalEquations) -> float:
    held = sum(2 * n * np.log(getattr(evidence.noise, f)) for f, n in _unstated(evidence) if f not in model.fields)
    return float(normal.cost) + _log_det(evidence, normal) + float(2 * _weighed(evidence, model) @ logs + held)


def _unstated(evidence: MarginalLikelihood) -> list[tuple[str, int]]:
    return [(name, count) for name, count in evidence.counts.items() if name != STATED and count]


def _with(evidence: MarginalLikelihood, sigmas: Sigmas) -> Problem:
    groups = []
    for group in evidence.problem.with_noise(sigmas.noise).groups:
        assert isinstance(group.measurement, CompressedMeasurement)
        groups.append(replace(group, measurement=group.measurement.with_factor(sigmas.factor)))
    return with_robot_noise(evidence.problem.with_groups(groups), sigmas.robots)


def _at(
    evidence: MarginalLikelihood, model: VarianceModel, before: Problem, state: State, logs: Array
) -> NormalEquations:
    """The problem with other sigmas about the same place, the same errors of stops in metres and radians."""
    problem = _with(evidence, sigmas_of(model, logs, evidence.noise))
    errors = state.stop_errors * before.stops.sigma / np.maximum(problem.stops.sigma, 1e-300)
    return linearise(problem, replace(state, stop_errors=errors))


def _log_det(evidence: MarginalLikelihood, normal: NormalEquations) -> float:
    return float(np.linalg.slogdet(normal.hessian + evidence.floor)[1]) + float(normal.stop_log_det)


def _weighed(evidence: MarginalLikelihood, model: VarianceModel) -> Array:
    """How many residuals go by each sigma, (k,); stop errors are counted by their log determinant."""
    counts = [evidence.counts[name] for name in model.fields] + [0] * (2 * len(model.pools))
    return np.array(counts + [evidence.counts.get(STATED, 0)] * model.factored, dtype=np.float64)


def _squares(model: VarianceModel, problem: Problem, state: State) -> Array:
    """The sum of squares over each sigma, (k,): half the negative derivative of the cost to its logarithm."""
    by_field: dict[str, float] = {}
    for group in problem.groups:
        assert isinstance(group.measurement, CompressedMeasurement)
        predicted, camera = state.camera_from_target(group, problem.stops), state.cameras.get(group.camera)
        for name, total in group.measurement.squares(predicted, camera, group.camera in problem.columns).items():
            by_field[name] = by_field.get(name, 0.0) + total
    robot = np.array(problem.stops.robot, dtype=object)
    squared = state.stop_errors**2
    of_robots = []
    for pool in model.pools:
        mine = squared[np.isin(robot, pool)]
        of_robots += [float(mine[:, :3].sum()), float(mine[:, 3:].sum())]
    return np.array([by_field[name] for name in model.fields] + of_robots + [by_field[STATED]] * model.factored)


def most_likely(evidence: MarginalLikelihood, model: VarianceModel, start: Array) -> VarianceComponents:
    """The model's most likely sigmas.

    Args:
        evidence: What the data say.
        model: Which sigmas are looked for.
        start: (k,) logarithms to begin with; NaN for those of robots where nothing is known.
    """
    first = min(_candidates(model, start), key=lambda logs: neg2_log_likelihood(evidence, model, logs))
    if not len(first):
        return VarianceComponents(model, first, neg2_log_likelihood(evidence, model, first))
    found = minimize(
        lambda logs: neg2_log_likelihood_slope(evidence, model, logs),
        first,
        method="L-BFGS-B",
        jac=True,
        bounds=bounds_of(model, start),
        options={"ftol": _TIGHT, "gtol": 1e-3},
    )
    return VarianceComponents(model, np.asarray(found.x), float(found.fun))


def _candidates(model: VarianceModel, start: Array) -> list[Array]:
    """Where to begin: the fields as they are or smaller, the robots from little noise to much."""
    if np.isfinite(start).all():
        return [start]
    out: list[Array] = []
    for share in _SHARE if model.fields else (1.0,):
        for part in _GRID:
            logs = start.copy()
            logs[: len(model.fields)] += np.log(share)
            logs[model.robots] = np.log(np.tile(part * np.array(LARGEST), len(model.pools)))
            out.append(logs)
    return out


def promising(evidence: MarginalLikelihood, plain: VarianceComponents, pool: tuple[str, ...]) -> bool:
    """Whether a little noise of these robots makes the data less surprising than none."""
    model = replace(plain.model, pools=(pool,))
    for little in np.diag(np.array(_LITTLE) - np.log(SMALLEST)) + np.log(SMALLEST):
        if neg2_log_likelihood(evidence, model, np.concatenate([plain.logs, little])) < plain.surprise:
            return True
    return False


def bounds_of(model: VarianceModel, start: Array) -> list[tuple[float, float]]:
    """Least and greatest logarithm of each sigma."""
    wide = float(np.log(_FACTOR))
    fields = [(float(v) - wide, float(v) + wide) for v in start[: len(model.fields)]]
    pair = [(float(np.log(least)), float(np.log(most))) for least, most in zip(SMALLEST, LARGEST, strict=True)]
    return fields + pair * len(model.pools) + [(-wide, wide)] * model.factored


def log_sigma_covariance(evidence: MarginalLikelihood, found: VarianceComponents) -> Array:
    """Covariance of the logarithms by the curvature, (k, k); zero for sigmas that vanish, which have none."""
    k = len(found.logs)
    steps = _CURVED * np.eye(k)
    ahead = np.array([neg2_log_likelihood_slope(evidence, found.model, found.logs + h)[1] for h in steps]).reshape(k, k)
    behind = np.array([neg2_log_likelihood_slope(evidence, found.model, found.logs - h)[1] for h in steps]).reshape(
        k, k
    )
    curvature = (ahead - behind) / (2 * _CURVED)
    curved = np.diag(curvature) > _FLAT
    out = np.zeros((k, k))
    half = 0.25 * (curvature + curvature.T)[np.ix_(curved, curved)]
    out[np.ix_(curved, curved)] = np.linalg.pinv(half, hermitian=True)
    return out
