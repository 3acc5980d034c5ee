"""Joint estimation of unstated sigmas: of views, of robots' stops, and of errors that a robot's stops share.

The estimation alternates between the optimum at given sigmas and the most likely sigmas about it, until both converge.
Each kind of shared errors defines an alternative to the plain model without shared errors. The covariance is averaged
over all models, weighted by prior and evidence. The state is that of the plain model. It predicts as well, and no
shared error can absorb a part of a mount. Source: docs/mathematics.md (5.2), (5.3).
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
from basecal.estimation.noise.mixed_model import GroupEstimates, make_estimates, mixed_model, open_jitter
from basecal.estimation.noise.neighbourhoods import merge_estimates, neighbourhoods, uses_neighbourhoods
from basecal.estimation.noise.random_effects import has_similar_errors, shared_term
from basecal.estimation.noise.robot_noise import (
    count_stops,
    recorded_subset,
    some_views,
    stop_poses,
    with_robot_noise,
    without_errors,
)
from basecal.estimation.noise.view_estimates import STATED
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.view.measurement import Noise
from basecal.geometry import Array
from basecal.numerics.levenberg_marquardt import CONVERGED_SIGMAS
from basecal.numerics.mixtures import probabilities

_MOST_ALTERNATIONS = 6  # maximum number of alternations of sigmas and optimum: two or three suffice
_SETTLED_CHANGE = 0.02  # tolerance of logarithms, and of shapes in sigmas: the precision of 1000 degrees of freedom
# Views per group that determine a sigma to 2 %, one step from the estimate of all views. A search from a distant start
# is slow with so many views, and uses fewer first.
MANY_VIEWS = 2000
_SOME_VIEWS = (500, MANY_VIEWS)
_NOMINAL_SIGMAS = (5e-4, 1e-3)  # [m, rad] robot noise at the first optimum: within a small factor of any arm's


def open_robots(problem: Problem) -> list[str]:
    """Names of the robots with unstated noise and with views."""
    return sorted(name for name in problem.unstated if count_stops(problem, name))


def estimate_jointly(
    problem: Problem,
    start: State,
    iterations: int,
    guess: NoiseEstimate | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Problem, Optimum, NoiseEstimate]:
    """Estimate all unstated sigmas of a problem jointly.

    Args:
        problem: The problem.
        start: The start.
        iterations: Maximum number of steps of each descent.
        guess: Estimate from nearly the same views, to start from.
        progress: Callback for neighbourhoods of robots; receives the number done and the total.

    Returns:
        The problem with the most likely sigmas, its optimum, and the sigmas.
    """
    # Far from an optimum, points may lie at the camera's centre; the infinities there are expected.
    with np.errstate(all="ignore"):
        if uses_neighbourhoods(problem) and not open_jitter(problem) and _is_open(problem):
            return _estimate_neighbourhoods(problem, start, iterations, progress or (lambda done, total: None))
        return _estimate_sigmas(problem, start, iterations, guess)


def _is_open(problem: Problem) -> bool:
    """Whether some sigma is unstated."""
    robots_or_times = open_robots(problem) or open_jitter(problem)
    return bool(robots_or_times) or any(n for name, n in residual_counts(problem).items() if name != STATED)


def _estimate_neighbourhoods(
    problem: Problem, start: State, iterations: int, progress: Callable[[int, int], None]
) -> tuple[Problem, Optimum, NoiseEstimate]:
    """Estimate the sigmas of each robot and its camera from its neighbourhood alone; see `estimate_jointly`."""
    parts = {part.robot: part for part in neighbourhoods(problem, start)}
    estimates = {}
    for done, (robot, part) in enumerate(parts.items()):
        progress(done, len(parts))
        estimates[robot] = _estimate_sigmas(part.problem, part.state, iterations, None)[2]
    noise = merge_estimates(estimates, parts)
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
        nominal = problem.with_noise(Noise())  # residuals under exact robots may not be noise of views
        used, logs = with_robot_noise(nominal, dict.fromkeys(robots, np.repeat(_NOMINAL_SIGMAS, 3))), None
        start = _clear_open_errors(problem, used, start, robots)
    else:
        used, logs = guess.apply(problem), guess.logs
        start = start if len(start.stop_errors) == len(used.stops) else without_errors(used, start)
    if max(map(len, problem.groups), default=0) > MANY_VIEWS:
        subset, subset_start = recorded_subset(problem, without_errors(problem, start), MANY_VIEWS)
        _, subset_end, estimate = _estimate_sigmas(subset, subset_start, iterations, guess)
        if subset_end.converged and estimate.converged and estimate.logs is not None:
            return _extend_estimate(estimate.apply(problem), subset_end.state, iterations, estimate.logs)
    end = bundle_adjust(used, start, dof, iterations, tolerance=ROUGH_SIGMAS)
    plain = _sigma_posterior(used, end.state, robots, logs)
    has_converged = logs is not None and _has_converged(plain, logs)
    for _ in range(_MOST_ALTERNATIONS):
        if has_converged:
            break
        used, end = _readjust(used, end, plain, dof, iterations, ROUGH_SIGMAS)
        previous, plain = plain.logs, _sigma_posterior(used, end.state, robots, plain.logs)
        has_converged = _has_converged(plain, previous)
    used, end = _readjust(used, end, plain, dof, iterations)
    return used, end, _final_estimate(plain, used, has_converged)


def _extend_estimate(
    problem: Problem, start: State, iterations: int, logs: Array
) -> tuple[Problem, Optimum, NoiseEstimate]:
    """Estimate the sigmas of all views from those of some views, one step away; see `estimate_jointly`."""
    dof = degrees_of_freedom(problem)
    end = bundle_adjust(problem, without_errors(problem, start), dof, iterations, tolerance=ROUGH_SIGMAS)
    plain = _sigma_posterior(problem, end.state, open_robots(problem), logs)
    problem, end = _readjust(problem, end, plain, dof, iterations)
    return problem, end, _final_estimate(plain, problem, True)


def _clear_open_errors(problem: Problem, nominal: Problem, state: State, robots: Sequence[str]) -> State:
    """Adapt a state to the stops of `nominal`: zero errors for `robots`, unchanged errors for other robots.

    A descent from zero errors takes many steps if views are more precise than robot poses.
    """
    kept = ~problem.stops.robot_mask(robots)
    errors = np.zeros((len(nominal.stops), 6))
    if len(state.stop_errors) == len(kept):
        errors[: kept.sum()] = state.stop_errors[kept]
    return replace(state, stop_errors=errors)


def _has_converged(posterior: SigmaPosterior, used_logs: Array) -> bool:
    """Whether sigmas and shapes of targets agree with those that were used, the former with logarithms (k,)."""
    changes = [np.abs(posterior.columns.mean[rows]).max() for rows in posterior.model.layout.shapes.values()]
    return bool(max(*changes, np.abs(posterior.logs - used_logs).max(initial=0.0), 0.0) < _SETTLED_CHANGE)


def integrate_sigmas(
    problem: Problem, state: State, noise: NoiseEstimate, is_quick: bool = False, guess: NoiseEstimate | None = None
) -> NoiseEstimate:
    """Add the covariance integrated over the sigmas and over all models of shared errors to a joint estimate.

    Args:
        problem: The problem with the most likely sigmas.
        state: The optimum of the problem.
        noise: The most likely sigmas.
        is_quick: Whether a covariance with an error of 10 % suffices.
        guess: Integrated estimate from nearly the same views, to start from.
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
    integrated = replace(noise, covariance=covariance, minus_2_log_evidence=best.minus_2_log_evidence, models=models)
    if not likeliest:
        return replace(integrated, common={}, beside_common=None)
    sigmas = _estimate(best, problem)
    single = replace(noise, robots=sigmas.robots, cameras=sigmas.cameras, jitter_s=sigmas.jitter_s)
    common = zip((likeliest, companion_name(likeliest, models)), _shared_sigmas(best), strict=False)
    return replace(integrated, common=dict(common), beside_common=single)


def model_priors(names: Sequence[str]) -> Array:
    """Prior probabilities of models, (n,): one half for the plain model, "", and equal shares of the rest for others.

    The plain model has probability zero if one of the effects is certain to occur in every arm.
    Source: Jeffreys, Theory of Probability, 1961.
    """
    others = [name for name in names if name]
    is_certain = any(RANDOM_EFFECTS[name].is_certain for name in others)
    exact = 0.0 if is_certain else float(len(others) or 1)
    shares = np.array([1.0 if name else exact for name in names])
    return np.asarray(shares / shares.sum())


def _likeliest(models: Mapping[str, SigmaPosterior]) -> str:
    return min(models, key=lambda name: models[name].minus_2_log_evidence)


def companion_name(name: str, models: Mapping[str, SigmaPosterior]) -> str:
    """Name of a model's second effect: for an effect of motion the likeliest other one, which may be ""; else ""."""
    if not name or RANDOM_EFFECTS[name].by_times is None:
        return ""
    others = [other for other in models if other != name]
    evidence = -np.array([models[other].minus_2_log_evidence for other in others])
    return others[int(np.argmax(probabilities(model_priors(others), evidence)))]


def _sigma_models(
    problem: Problem, state: State, noise: NoiseEstimate, earlier: Mapping[str, SigmaPosterior]
) -> dict[str, SigmaPosterior]:
    """Posteriors of the sigmas of all models, by name: the plain model, "", and one for each shared effect.

    Args:
        problem: The problem with the most likely sigmas.
        state: The optimum of the problem.
        noise: The most likely sigmas, estimated jointly.
        earlier: Models whose sigmas are start values; other models start from those of `noise`.
    """
    robots = open_robots(problem)
    with np.errstate(all="ignore"):
        estimates = make_estimates(*_unit_problem(problem, state, robots))
        models = {"": _sigma_posterior(problem, state, robots, noise.logs, estimates=estimates)}
        # Effects of motion are last, since they are combined with the likeliest other effect.
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
    """Posterior of the sigmas of a model with the given shared errors.

    Args:
        problem: The problem with the most likely sigmas.
        state: The optimum of the problem.
        noise: The most likely sigmas, estimated jointly.
        terms: Shared errors of some of `open_robots`, of at most two kinds.
    """
    with np.errstate(all="ignore"):
        return _sigma_posterior(problem, state, open_robots(problem), noise.logs, terms)


def _readjust(
    problem: Problem,
    end: Optimum,
    posterior: SigmaPosterior,
    dof: int,
    iterations: int,
    tolerance: float = CONVERGED_SIGMAS,
) -> tuple[Problem, Optimum]:
    """Update the problem with the most likely sigmas, and find its optimum from the last one."""
    # Errors of stops stay unchanged in metres and radians.
    robots = list(posterior.model.sigmas.stops)
    physical = end.state.stop_errors * _units(problem, robots)
    problem = _estimate(posterior, problem).apply(problem)
    state = replace(end.state, stop_errors=physical / _units(problem, robots))
    return problem, bundle_adjust(problem, state, dof, iterations, tolerance=tolerance)


def _sigma_posterior(
    problem: Problem,
    state: State,
    robots: Sequence[str],
    logs: Array | None,
    terms: Sequence[SharedTerm] = (),
    estimates: GroupEstimates | None = None,
) -> SigmaPosterior:
    """Posterior of the sigmas about a state, searched from `logs`, with shared errors of at most two kinds.

    Without start values or with shared errors, the search uses a subset of the views first. `estimates` may pass the
    result of `make_estimates` for all views.
    """
    unit, physical = _unit_problem(problem, state, robots)
    reach_m = {name: _reach(problem, name) for name in robots}

    def find_mode(
        subset: Problem, subset_state: State, start: Array | None, estimates: GroupEstimates | None = None
    ) -> SigmaPosterior:
        """Find the posterior's mode from the views of a problem."""
        model = mixed_model(subset, subset_state, robots, [each.errors for each in terms], estimates)
        return sigma_posterior(model, hyperpriors(model, reach_m, [each.prior for each in terms]), start)

    has_near_start = logs is not None and not terms
    for count in () if has_near_start else _SOME_VIEWS:
        if max(map(len, unit.groups), default=0) > count:
            logs = find_mode(*some_views(unit, physical, count), logs).logs
    return find_mode(unit, physical, logs, estimates)


def _unit_problem(problem: Problem, state: State, robots: Sequence[str]) -> tuple[Problem, State]:
    """Return the problem with unit sigmas for the robots' stops, and the state with their errors in [m, rad]."""
    unit = with_robot_noise(problem, {name: np.ones(6) for name in robots})
    return unit, replace(state, stop_errors=state.stop_errors * _units(problem, robots))


def _units(problem: Problem, robots: Sequence[str]) -> Array:
    """Factors from sigmas to metres and radians for errors of these robots' stops, (k, 6); 1 for other robots."""
    return np.where(problem.stops.robot_mask(robots)[:, None], problem.stops.sigma, 1.0)


def _reach(problem: Problem, robot: str) -> float:
    """Distance of a robot's flange from its base, root mean square over stops [m]."""
    poses, seen = stop_poses(problem, robot)
    return float(np.sqrt(np.mean(np.sum(poses.translation[seen] ** 2, -1))))


def _shared_sigmas(posterior: SigmaPosterior) -> list[dict[str, Array]]:
    """Most likely sigmas of each kind of shared errors, (2,) [m, rad], by robot."""
    model = posterior.model
    return [
        {robot: np.exp(posterior.logs[at]) for robot, at in places.items() if robot in robots}
        for places, robots in zip(model.sigmas.shared, model.layout.shared, strict=True)
    ]


def _final_estimate(posterior: SigmaPosterior, problem: Problem, has_converged: bool) -> NoiseEstimate:
    """Return the most likely sigmas, with the shapes of the problem."""
    estimate = _estimate(posterior, problem)
    shapes = {name: (problem.shapes.get(name, mean), spread) for name, (mean, spread) in estimate.shapes.items()}
    return replace(estimate, converged=has_converged, shapes=shapes)


def _estimate(posterior: SigmaPosterior, problem: Problem) -> NoiseEstimate:
    """Return the most likely sigmas, and the problem's shapes with their estimated corrections."""
    model, values, places = posterior.model, np.exp(posterior.logs), posterior.model.sigmas
    # Root mean squares of the log-normal sigmas: the most likely ones are too small to predict future errors.
    raised = np.exp(posterior.logs + np.diag(posterior.covariance))
    cameras: dict[str, Noise] = {}
    for (camera, name), at in places.views.items():
        cameras[camera] = cameras.get(camera, Noise())._replace(**{name: float(values[at])})
    shapes = {}
    for target, rows in model.layout.shapes.items():
        current = problem.shapes.get(target, np.zeros(rows.stop - rows.start))
        shapes[target] = current + posterior.columns.mean[rows], posterior.columns.spread[rows, rows]
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
