"""Unstated sigmas, estimated jointly: of views, of robots' stops, and of errors that a robot's stops share.

The optimum at some sigmas, the most likely sigmas about it, and again until they rest. Each term that stops may share
is a model beside the first: all count by prior and evidence in how well the answer is known. The answer itself is that
of the first, which predicts as well and lets no such term take up what belongs to a mount.
Source: docs/mathematics.md (5.2), (5.3).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from basecal.effects.faces.shared_errors import SharedTerm
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.least_squares.bundle_adjustment import ROUGH_SIGMAS, Optimum, bundle_adjust
from basecal.estimation.noise.estimate import NoiseEstimate, degrees_of_freedom, estimate_noise, residual_counts
from basecal.estimation.noise.hyperpriors import hyperpriors
from basecal.estimation.noise.laplace import (
    SigmaPosterior,
    integrated_covariance,
    sigma_posterior,
)
from basecal.estimation.noise.mixed_model import EstimatesOf, make_estimates, mixed_model, open_jitter
from basecal.estimation.noise.neighbourhoods import goes_by_neighbourhoods, merge_estimates, neighbourhoods
from basecal.estimation.noise.random_effects import has_similar_errors, shared_term
from basecal.estimation.noise.robot_noise import (
    count_stops,
    recorded_subset,
    some_views,
    stands,
    with_robot_noise,
    without_errors,
)
from basecal.estimation.noise.view_estimates import STATED
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.view.measurement import Noise
from basecal.geometry import Array
from basecal.numerics.levenberg_marquardt import CONVERGED_SIGMAS
from basecal.numerics.mixtures import probabilities

_ALTERNATIONS = 6  # of sigmas and optimum in turn: two or three do
_SETTLED_CHANGE = 0.02  # of logarithms, and of shapes in sigmas: as well as a thousand freedoms tell them
# Of a group: so many tell a sigma to two in a hundred, a step away from that of all; a search that begins far away is
# mostly waiting among so many, and goes by fewer first.
MANY_VIEWS = 2000
_SOME_VIEWS = (500, MANY_VIEWS)
_NOMINAL = (5e-4, 1e-3)  # [m, rad] of the first optimum: within a factor of a few of any arm's


def open_robots(problem: Problem) -> list[str]:
    """Robots that state no noise and were seen."""
    return sorted(name for name in problem.unstated if count_stops(problem, name))


def estimate_jointly(
    problem: Problem,
    start: State,
    iterations: int,
    guess: NoiseEstimate | None = None,
    step: Callable[[int, int], None] | None = None,
) -> tuple[Problem, Optimum, NoiseEstimate]:
    """The problem with the most likely unstated sigmas, its optimum, and these sigmas.

    Args:
        problem: The problem.
        start: Where to start.
        iterations: Steps of a descent, at most.
        guess: What was estimated of nearly the same views, to start from.
        step: Called with the neighbourhoods of robots that are done, and all, where it goes by these.
    """
    # States far from any optimum meet points at the camera's centre: infinities there are no error of the user's.
    with np.errstate(all="ignore"):
        if goes_by_neighbourhoods(problem) and not open_jitter(problem) and _is_open(problem):
            return _estimate_neighbourhoods(problem, start, iterations, step or (lambda done, total: None))
        return _estimate_sigmas(problem, start, iterations, guess)


def _is_open(problem: Problem) -> bool:
    """Whether some sigma is stated by nobody."""
    robots_or_times = open_robots(problem) or open_jitter(problem)
    return bool(robots_or_times) or any(n for name, n in residual_counts(problem).items() if name != STATED)


def _estimate_neighbourhoods(
    problem: Problem, start: State, iterations: int, step: Callable[[int, int], None]
) -> tuple[Problem, Optimum, NoiseEstimate]:
    """As `estimate_jointly`, the sigmas of each robot and its camera by the views that these take part in."""
    parts = {part.robot: part for part in neighbourhoods(problem, start)}
    found = {}
    for done, (robot, part) in enumerate(parts.items()):
        step(done, len(parts))
        found[robot] = _estimate_sigmas(part.problem, part.state, iterations, None)[2]
    noise = merge_estimates(found, parts)
    used = noise.apply(problem)
    end = bundle_adjust(used, without_errors(used, start), degrees_of_freedom(used), iterations)
    return used, end, noise


def _estimate_sigmas(
    problem: Problem, start: State, iterations: int, guess: NoiseEstimate | None
) -> tuple[Problem, Optimum, NoiseEstimate]:
    robots, dof = open_robots(problem), degrees_of_freedom(problem)
    if not _is_open(problem):
        return estimate_noise(problem, bundle_adjust(problem, start, dof, iterations), iterations)
    if guess is None or guess.logs is None:
        nominal = problem.with_noise(Noise())  # what exact arms leave to views may be no noise at all
        used, logs = with_robot_noise(nominal, dict.fromkeys(robots, np.repeat(_NOMINAL, 3))), None
        start = _clear_open_errors(problem, used, start, robots)
    else:
        used, logs = guess.apply(problem), guess.logs
        start = start if len(start.stop_errors) == len(used.stops) else without_errors(used, start)
    if max(map(len, problem.groups), default=0) > MANY_VIEWS:
        few, few_start = recorded_subset(problem, without_errors(problem, start), MANY_VIEWS)
        _, few_end, found = _estimate_sigmas(few, few_start, iterations, guess)
        if few_end.converged and found.settled and found.logs is not None:
            return _extend_estimate(found.apply(problem), few_end.state, iterations, found.logs)
    end, settled = bundle_adjust(used, start, dof, iterations, sigmas=ROUGH_SIGMAS), False
    plain = _sigma_posterior(used, end.state, robots, logs)
    for _ in range(_ALTERNATIONS):
        used, end = _readjust(used, end, plain, dof, iterations, ROUGH_SIGMAS)
        before, plain = plain.logs, _sigma_posterior(used, end.state, robots, plain.logs)
        settled = bool(np.abs(plain.logs - before).max(initial=0.0) < _SETTLED_CHANGE) and _has_settled_shapes(plain)
        if settled:
            break
    used, end = _readjust(used, end, plain, dof, iterations)
    return used, end, _final_estimate(plain, used, settled)


def _extend_estimate(
    problem: Problem, start: State, iterations: int, logs: Array
) -> tuple[Problem, Optimum, NoiseEstimate]:
    """As `estimate_jointly`, where the sigmas of some of the views are known: those of all are a step away."""
    dof = degrees_of_freedom(problem)
    end = bundle_adjust(problem, without_errors(problem, start), dof, iterations, sigmas=ROUGH_SIGMAS)
    plain = _sigma_posterior(problem, end.state, open_robots(problem), logs)
    problem, end = _readjust(problem, end, plain, dof, iterations)
    return problem, end, _final_estimate(plain, problem, True)


def _clear_open_errors(problem: Problem, nominal: Problem, state: State, robots: Sequence[str]) -> State:
    """The state with the stops of `nominal`: no errors of `robots`, and those of other robots as they were.

    A descent from no errors at all takes many steps if views say more than poses do.
    """
    kept = ~np.isin(np.array(problem.stops.robot, dtype=object), list(robots))
    errors = np.zeros((len(nominal.stops), 6))
    if len(state.stop_errors) == len(kept):
        errors[: kept.sum()] = state.stop_errors[kept]
    return replace(state, stop_errors=errors)


def _has_settled_shapes(posterior: SigmaPosterior) -> bool:
    """Whether shapes are where the model was made about."""
    off = [np.abs(posterior.columns.mean[rows]).max() for rows in posterior.model.layout.shapes.values()]
    return max(off, default=0.0) < _SETTLED_CHANGE


def integrate_sigmas(
    problem: Problem, state: State, noise: NoiseEstimate, is_quick: bool = False, guess: NoiseEstimate | None = None
) -> NoiseEstimate:
    """The joint estimate, with the covariance over all values of the sigmas, and all shared terms.

    Args:
        problem: The problem with the most likely sigmas.
        state: Its optimum.
        noise: These sigmas.
        is_quick: Whether a covariance that is good to a tenth will do.
        guess: The integrated sigmas of nearly the same views, to start from.
    """
    if noise.logs is None:
        return noise
    models = _sigma_models(problem, state, noise, {} if guess is None else guess.models)
    likeliest = _likeliest(models)
    with np.errstate(all="ignore"):
        covariance = integrated_covariance(
            list(models.values()), model_priors(list(models)), np.zeros(problem.width), is_quick
        )
    best = models[likeliest]
    found = replace(noise, covariance=covariance, minus_2_log_evidence=best.minus_2_log_evidence, models=models)
    if not likeliest:
        return replace(found, common={}, beside_common=None)
    sigmas = _estimate(best, problem)
    beside = replace(noise, robots=sigmas.robots, cameras=sigmas.cameras, jitter_s=sigmas.jitter_s)
    common = zip((likeliest, companion_name(likeliest, models)), _shared_sigmas(best), strict=False)
    return replace(found, common=dict(common), beside_common=beside)


def model_priors(names: Sequence[str]) -> Array:
    """Probabilities of models before the data, (n,): without shared errors, "", in one case of two, others equally.

    Without such errors none is, where every arm has some of an effect. Source: Jeffreys, Theory of Probability, 1961.
    """
    others = [name for name in names if name]
    is_certain = any(RANDOM_EFFECTS[name].is_certain for name in others)
    exact = 0.0 if is_certain else float(len(others) or 1)
    shares = np.array([1.0 if name else exact for name in names])
    return np.asarray(shares / shares.sum())


def _likeliest(models: Mapping[str, SigmaPosterior]) -> str:
    return min(models, key=lambda name: models[name].minus_2_log_evidence)


def companion_name(name: str, models: Mapping[str, SigmaPosterior]) -> str:
    """The effect beside that of a model: beside that of motion the likeliest other, and "" where that is none."""
    if not name or RANDOM_EFFECTS[name].by_times is None:
        return ""
    others = [other for other in models if other != name]
    evidence = -np.array([models[other].minus_2_log_evidence for other in others])
    return others[int(np.argmax(probabilities(model_priors(others), evidence)))]


def _sigma_models(
    problem: Problem, state: State, noise: NoiseEstimate, earlier: Mapping[str, SigmaPosterior]
) -> dict[str, SigmaPosterior]:
    """The sigmas of single stops and views alone, by "", and with each term that stops may share, by name.

    Args:
        problem: The problem with the most likely sigmas.
        state: Its optimum.
        noise: These sigmas, estimated jointly.
        earlier: Models whose sigmas to start from; those of `noise` for the other models.
    """
    robots = open_robots(problem)
    with np.errstate(all="ignore"):
        estimates = make_estimates(*_unit_problem(problem, state, robots))
        models = {"": _sigma_posterior(problem, state, robots, noise.logs, estimates=estimates)}
        # That of motion is the last, since it has the likeliest other beside it.
        for name, effect in sorted(RANDOM_EFFECTS.items(), key=lambda each: each[1].by_times is not None):
            term = shared_term(problem, name, robots)
            if term is not None and (effect.by_times is None or has_similar_errors(models[""], term.errors)):
                logs = earlier[name].logs if name in earlier else noise.logs
                second = shared_term(problem, companion_name(name, models), robots)
                terms = [term] if second is None else [term, second]
                models[name] = _sigma_posterior(problem, state, robots, logs, terms, estimates)
    return models


def model_sigmas(
    problem: Problem, state: State, noise: NoiseEstimate, terms: Sequence[SharedTerm] = ()
) -> SigmaPosterior:
    """The sigmas of a model, which may have more shared errors.

    Args:
        problem: The problem with the most likely sigmas.
        state: Its optimum.
        noise: These sigmas, estimated jointly.
        terms: Kinds of errors that stops of some of `open_robots` share, two at most.
    """
    with np.errstate(all="ignore"):
        return _sigma_posterior(problem, state, open_robots(problem), noise.logs, terms)


def _readjust(
    problem: Problem,
    end: Optimum,
    posterior: SigmaPosterior,
    dof: int,
    iterations: int,
    sigmas: float = CONVERGED_SIGMAS,
) -> tuple[Problem, Optimum]:
    """The problem with the most likely sigmas, and its optimum near the last."""
    # Errors of stops stay the same in metres and radians.
    robots = list(posterior.model.sigmas.stops)
    physical = end.state.stop_errors * _units(problem, robots)
    problem = _estimate(posterior, problem).apply(problem)
    state = replace(end.state, stop_errors=physical / _units(problem, robots))
    return problem, bundle_adjust(problem, state, dof, iterations, sigmas=sigmas)


def _sigma_posterior(
    base_problem: Problem,
    state: State,
    robots: Sequence[str],
    logs: Array | None,
    terms: Sequence[SharedTerm] = (),
    estimates: EstimatesOf | None = None,
) -> SigmaPosterior:
    """The sigmas about a state, looked for from `logs`; also of shared errors of stops, of two kinds at most.

    Where nothing near them is known, those of some of the views come first. What all views say is given as `estimates`
    where it is known.
    """
    unit, physical = _unit_problem(base_problem, state, robots)
    reach_m = {name: _reach(base_problem, name) for name in robots}

    def find_mode(
        problem: Problem, state: State, start: Array | None, estimates: EstimatesOf | None = None
    ) -> SigmaPosterior:
        """The mode of a problem's views."""
        model = mixed_model(problem, state, robots, [each.errors for each in terms], estimates)
        return sigma_posterior(model, hyperpriors(model, reach_m, [each.prior for each in terms]), start)

    is_near = logs is not None and not terms
    for most in () if is_near else _SOME_VIEWS:
        if max(map(len, unit.groups), default=0) > most:
            logs = find_mode(*some_views(unit, physical, most), logs).logs
    return find_mode(unit, physical, logs, estimates)


def _unit_problem(problem: Problem, state: State, robots: Sequence[str]) -> tuple[Problem, State]:
    """The problem with unit sigmas of these robots' stops, and the state with their errors in metres and radians."""
    unit = with_robot_noise(problem, {name: np.ones(6) for name in robots})
    return unit, replace(state, stop_errors=state.stop_errors * _units(problem, robots))


def _units(problem: Problem, robots: Sequence[str]) -> Array:
    """Factors from errors of stops to metres and radians if the robot's sigma is open, (k, 6); 1 elsewhere."""
    mine = np.isin(np.array(problem.stops.robot, dtype=object), list(robots))
    return np.where(mine[:, None], problem.stops.sigma, 1.0)


def _reach(problem: Problem, robot: str) -> float:
    """How far a robot's flange is from its base, root of the mean square over stops [m]."""
    poses, seen = stands(problem, robot)
    return float(np.sqrt(np.mean(np.sum(poses.translation[seen] ** 2, -1))))


def _shared_sigmas(posterior: SigmaPosterior) -> list[dict[str, Array]]:
    """The most likely sigmas of each kind of errors that stops share, (2,) [m, rad], by robot."""
    model = posterior.model
    return [
        {robot: np.exp(posterior.logs[at]) for robot, at in places.items() if robot in robots}
        for places, robots in zip(model.sigmas.shared, model.layout.shared, strict=True)
    ]


def _final_estimate(posterior: SigmaPosterior, problem: Problem, is_settled: bool) -> NoiseEstimate:
    """The most likely sigmas, and the shapes that the problem has."""
    found = _estimate(posterior, problem)
    shapes = {name: (problem.shapes.get(name, mean), spread) for name, (mean, spread) in found.shapes.items()}
    return replace(found, settled=is_settled, shapes=shapes)


def _estimate(posterior: SigmaPosterior, problem: Problem) -> NoiseEstimate:
    """The most likely sigmas, and shapes that add to those of the problem."""
    model, values, places = posterior.model, np.exp(posterior.logs), posterior.model.sigmas
    # The mean of the square of what is log-normal: the likeliest sigmas are too small for what is still to come.
    raised = np.exp(posterior.logs + np.diag(posterior.covariance))
    cameras: dict[str, Noise] = {}
    for (camera, name), at in places.views.items():
        cameras[camera] = cameras.get(camera, Noise())._replace(**{name: float(values[at])})
    shapes = {}
    for target, rows in model.layout.shapes.items():
        before = problem.shapes.get(target, np.zeros(rows.stop - rows.start))
        shapes[target] = before + posterior.columns.mean[rows], posterior.columns.spread[rows, rows]
    return NoiseEstimate(
        next(iter(cameras.values()), Noise()),
        1.0,
        tuple(f for f in Noise._fields if any(name == f for _, name in places.views)),
        True,
        {robot: np.repeat(values[at], 3) for robot, at in places.stops.items()},
        cameras,
        minus_2_log_evidence=posterior.minus_2_log_evidence,
        plain_minus_2_log_evidence=posterior.minus_2_log_evidence,
        shapes=shapes,
        logs=posterior.logs,
        jitter_s={camera: float(values[at]) for camera, at in places.jitter.items()},
        robot_variances={robot: np.repeat(raised[at], 3) ** 2 for robot, at in places.stops.items()},
    )
