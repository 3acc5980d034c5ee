"""Scenarios, and the error of the base in one cell, compared with its covariance and the bound."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from basecal.cell.cell import Status
from basecal.cell.targets.points import points_target
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.noise.robot_noise import with_robot_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import RobotNoise, Settings
from basecal.estimation.solve import solve_from
from basecal.estimation.view.measurement import Noise
from basecal.geometry import Array
from basecal.simulation import Scenario, simulate
from basecal.simulation.scenario import SimulatedCell

BASE = "eye_base_from_hand_base"
FREEDOMS = 6
CHANCE = 4.65e-4
FAR_QUANTILE = 0.99
ROBOTS = (3e-4, 5e-4)
ROBOTS_WITH_LED = (1e-4, 1e-4)
_CORNERS = [[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]
SMALL_M, SMALL_RAD = 0.01, 0.01
TAG_M = 0.12
_BOARD = Scenario(samples=20)
_LIGHT = Scenario(samples=30, target="led")
_TAG = Scenario(samples=20, target="points", board=points_target(TAG_M * np.array(_CORNERS)))


def _mounts(scenario: Scenario, status: Status) -> Scenario:
    return replace(scenario, camera_mount=status, target_mount=status)


# An arm that stands still leaves the mount on its flange and the base one transform: that mount must be known, exactly
# or by a prior. A light seen from a still hand is one place in space, three numbers for a base's six: left out.
# Twenty samples for a board; thirty for a light, whose every sample gives two equations.
PIXEL_NOISE: dict[str, Scenario] = {
    # The paper's problem, and the design's three statuses, with both arms moving.
    "board, mounts fixed": _mounts(_BOARD, "fixed"),
    "board, mounts free": _BOARD,
    "board, mounts by priors": _mounts(_BOARD, "prior"),
    # Each arm still for half of the samples: everything is seen, from fewer directions.
    "board, mounts free, halves": replace(_BOARD, arms="halves"),
    # One arm still throughout, the other mount known or free; with priors, the still mount's sigma governs the base's.
    "board, eye still, mounts fixed": _mounts(replace(_BOARD, arms="eye_still"), "fixed"),
    "board, eye still, target free": replace(_BOARD, arms="eye_still", camera_mount="fixed"),
    "board, eye still, mounts by priors": _mounts(replace(_BOARD, arms="eye_still"), "prior"),
    "board, hand still, mounts fixed": _mounts(replace(_BOARD, arms="hand_still"), "fixed"),
    "board, hand still, camera free": replace(_BOARD, arms="hand_still", target_mount="fixed"),
    # The same with a light, whose mount is three numbers.
    "light, mounts fixed": _mounts(_LIGHT, "fixed"),
    "light, offset free": replace(_LIGHT, camera_mount="fixed"),
    "light, mounts free": _LIGHT,
    "light, mounts by priors": _mounts(_LIGHT, "prior"),
    "light, eye still, mounts fixed": _mounts(replace(_LIGHT, arms="eye_still"), "fixed"),
    "light, eye still, offset free": replace(_LIGHT, arms="eye_still", camera_mount="fixed"),
    # A tag's four corners; the eye at five stations, the hand moving at each.
    "tag, mounts fixed": _mounts(_TAG, "fixed"),
    "tag, mounts free": _TAG,
    "tag, mounts by priors": _mounts(_TAG, "prior"),
    "tag, eye still, mounts fixed": _mounts(replace(_TAG, arms="eye_still"), "fixed"),
    "tag, stations, mounts free": replace(_TAG, arms="stations"),
    "board, stations, mounts free": replace(_BOARD, arms="stations"),
    # Few samples, and many.
    "board, mounts free, 8 samples": replace(_BOARD, samples=8),
    "tag, mounts fixed, 8 samples": replace(_mounts(_TAG, "fixed"), samples=8),
    "light, mounts fixed, 10 samples": replace(_mounts(_LIGHT, "fixed"), samples=10),
    "board, mounts free, 60 samples": replace(_BOARD, samples=60),
    "tag, stations, mounts free, 60 samples": replace(_TAG, arms="stations", samples=60),
    "light, mounts free, 60 samples": replace(_LIGHT, samples=60),
}


def _with_robot_noise(scenario: Scenario) -> Scenario:
    return replace(scenario, robot_noise=ROBOTS_WITH_LED if scenario.target == "led" else ROBOTS)


SCENARIOS = PIXEL_NOISE | {f"{name}, robot noise": _with_robot_noise(s) for name, s in PIXEL_NOISE.items()}


# Unstated sigmas: of pixels, with few and with more degrees of freedom; of robots, with pixels stated or not.
_NOISY = replace(_BOARD, robot_noise=ROBOTS, state_robot_noise=False)
ESTIMATED: dict[str, Scenario] = {
    "light, mounts fixed, 8 samples, pixel sigma": replace(
        _mounts(_LIGHT, "fixed"), samples=8, state_pixel_noise=False
    ),
    "light, mounts free, pixel sigma": replace(_LIGHT, state_pixel_noise=False),
    "tag, mounts free, 8 samples, pixel sigma": replace(_TAG, samples=8, state_pixel_noise=False),
    "board, mounts by priors, pixel sigma": replace(_mounts(_BOARD, "prior"), state_pixel_noise=False),
    "board, mounts free, 15 samples, robots": replace(_NOISY, samples=15),
    "board, mounts free, 30 samples, robots": replace(_NOISY, samples=30),
    "board, mounts free, 60 samples, robots": replace(_NOISY, samples=60),
    "board, mounts fixed, robots and pixel sigma": replace(_mounts(_NOISY, "fixed"), state_pixel_noise=False),
    "board, stations, target free, robots": replace(_NOISY, arms="stations", camera_mount="fixed"),
    "board, eye still, target free, robots": replace(_NOISY, arms="eye_still", camera_mount="fixed"),
}


class Error(NamedTuple):
    """Error of the base in one cell; pairs are for translation [m] and rotation [rad].

    Attributes:
        nees: Squared error in units of the covariance.
        nees_by_bound: Squared error in units of the bound.
        converged: Whether the descent converged.
        seconds: Time of the solution.
        squared: Squared norms of the errors.
        bound: Expected squared norms by the bound.
        largest: Largest sigma of an axis by the bound.
        inflation: Expected factor of `nees` because sigmas are estimated.
        robots: Sigmas of the robots, if they are estimated.
    """

    nees: float
    nees_by_bound: float
    converged: bool
    seconds: float
    squared: tuple[float, float]
    bound: tuple[float, float]
    largest: tuple[float, float]
    inflation: float
    robots: tuple[float, float] | None


def base_error(scenario: Scenario, seed: int, robot_noise: RobotNoise | None = None) -> Error:
    """Solve one cell from the truth; `benchmarks.starts` shows that other starts end there as well."""
    simulated = simulate(scenario, seed)
    problem, _ = build_problem(simulated.cell, simulated.recording)
    truth = State(simulated.truth, simulated.cameras if problem.lenses else {}, np.zeros((len(problem.stops), 6)))
    settings = Settings(robot_noise=robot_noise or ("stated" if scenario.state_robot_noise else "estimated"))
    began = time.perf_counter()
    solution = solve_from(problem, truth, settings)
    took = time.perf_counter() - began
    estimate = solution.transforms[BASE]
    xi = (estimate.mean.inverse() @ simulated.truth[BASE]).log()
    is_observable = BASE not in solution.observability.unobservable
    bound = base_bound(scenario, simulated, problem)
    # Integrated sigmas are in the covariance; with one common factor its statistic has an F distribution.
    has_common_factor = solution.noise.covariance is None and solution.noise.estimated
    freedoms = float(degrees_of_freedom(solution.problem)) if has_common_factor else float("inf")
    sigma = next(iter(solution.noise.robots.values()), None)
    return Error(
        float(xi @ np.linalg.solve(estimate.covariance, xi)) if is_observable else float("nan"),
        float(xi @ np.linalg.solve(bound, xi)),
        solution.converged,
        took,
        (float(xi[:3] @ xi[:3]), float(xi[3:] @ xi[3:])),
        (float(np.trace(bound[:3, :3])), float(np.trace(bound[3:, 3:]))),
        (float(np.sqrt(np.diag(bound)[:3].max())), float(np.sqrt(np.diag(bound)[3:].max()))),
        freedoms / (freedoms - 2) if np.isfinite(freedoms) else 1.0,
        None if sigma is None else (float(sigma[0]), float(sigma[3])),
    )


def base_bound(scenario: Scenario, simulated: SimulatedCell, problem: Problem) -> Array:
    """The Cramer-Rao bound of the base, (6, 6): the inverse information at the truth, with the true sigmas."""
    true_sigmas = np.repeat(scenario.robot_noise, 3)
    if np.any(true_sigmas) and not scenario.state_robot_noise:
        problem = with_robot_noise(problem, dict.fromkeys(simulated.cell.robots, true_sigmas))
    problem = problem.with_noise(Noise(pixel_px=scenario.pixel_px))
    lenses = simulated.cameras if problem.lenses else {}
    state = State(simulated.truth, lenses, _true_errors(simulated, problem))
    columns = problem.columns[BASE]
    bound: Array = np.linalg.inv(linearise(problem, state).hessian)[columns, columns]
    return bound


def _true_errors(simulated: SimulatedCell, problem: Problem) -> Array:
    """The true errors of the stops, (k, 6) in sigmas."""
    errors = np.zeros((len(problem.stops), 6))
    row = {sample.sample: k for k, sample in enumerate(simulated.recording.samples)}
    for group in problem.groups:
        rows = [row[int(number)] for number in group.sample]
        for end in group.ends:
            if end.robot is not None and end.has_noise:
                error = (end.flange_from_base @ simulated.true_base_from_flange[end.robot][rows]).log()
                errors[end.stop] = error / problem.stops.sigma[end.stop]
    return errors


def band(cells: int, chance: float = CHANCE) -> tuple[float, float]:
    """The interval of the mean of NEES / 6 over `cells`, with probability 1 - `chance`."""
    freedoms = FREEDOMS * cells
    low, high = chi2.ppf([chance / 2, 1 - chance / 2], freedoms) / freedoms
    return float(low), float(high)
