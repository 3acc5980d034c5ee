"""Estimate all unknowns of a cell from a recording, with covariance: initial guess and maximum likelihood alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Cell, Finding, Recording
from basecal.cell.recording_check import check_recording
from basecal.errors import InputError, check_type
from basecal.estimation.axis_shift.stations import find_stations, fuse_bases
from basecal.estimation.joint_state import joint_state
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.noise.estimate import (
    PLAUSIBLE_PX,
    PLAUSIBLE_SIGMAS,
    PLAUSIBLE_TOUCH_M,
    NoiseEstimate,
    degrees_of_freedom,
    estimate_noise,
    residual_counts,
)
from basecal.estimation.noise.joint_estimate import estimate_jointly, integrate_sigmas
from basecal.estimation.observability.observability import Observability, analyse_observability, sparse_observability
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.correspondence import choose_correspondence
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import STATED, Settings
from basecal.estimation.start.first_state import first_state, guessed_state, lenses
from basecal.estimation.streams.streams import synchronous_recording
from basecal.estimation.view.measurement import Noise
from basecal.geometry import SE3, Array, PoseEstimate
from basecal.numerics.spectral import spectrum
from basecal.numerics.threads import limit_threads

_MOST_READING_ROUNDS = 6  # most rounds of choosing correspondences; assumed
_LARGEST_FACTOR = 1e30  # keeps covariances finite if exact robots cannot explain the data at all
# Residuals of measured poses and points [m, rad] beyond which another start is tried; assumed. Lower limits cost time,
# higher limits hide wrong optima: `benchmarks.starts`.
_PLAUSIBLE_M, _PLAUSIBLE_RAD = 0.02, 0.05

SAME_COST = 1e-6
"""Relative difference of costs below which two descents have reached the same optimum.

Each descent ends within `CONVERGED_SIGMAS` of its optimum, 1e-5 sigmas, where the cost differs by 1e-10.
"""


@dataclass(frozen=True, eq=False)
class Solution:
    """Maximum-likelihood state with covariance and observability.

    Attributes:
        problem: The problem that was solved, with the noise in use.
        state: The optimum.
        covariance: (p, p) covariance of all columns of `problem`; zero in unobservable directions.
        observability: Directions that the data determine.
        noise: Sigmas in use, stated or estimated.
        cost: Sum of squared residuals over sigmas.
        dof: Degrees of freedom: scalar residuals minus unknowns.
        converged: Whether the state is an optimum.
        findings: Findings about samples that were not used.
        disputed: Whether several starts were tried and ended in different optima.
    """

    problem: Problem
    state: State
    covariance: Array
    observability: Observability
    noise: NoiseEstimate
    cost: float
    dof: int
    converged: bool
    findings: tuple[Finding, ...]
    disputed: bool = False

    def __repr__(self) -> str:
        """Summary in one line."""
        free = [f"{name} {each.words()}" for name, each in self.transforms.items() if name in self.problem.columns]
        state = "converged" if self.converged else "unconverged"
        return f"<{state} solution: {'; '.join(free) or 'no transform'}; chi-square {self.cost:.4g} of {self.dof}>"

    @property
    def transforms(self) -> dict[str, PoseEstimate]:
        """All transforms by name, with (6, 6) covariances; zero rotation covariance for the mount of a single point."""
        return {
            name: PoseEstimate(mean, self.joint_transform_covariance([name]))
            for name, mean in self.state.transforms.items()
        }

    def joint_transform_covariance(self, names: list[str]) -> Array:
        """Joint covariance of named transforms, (6 n, 6 n) [m, rad]; zero for fixed transforms."""
        covariance = np.zeros((6 * len(names), 6 * len(names)))
        rows, sources = [], []
        for i, name in enumerate(names):
            columns = self.problem.columns.get(name)
            if columns is not None:
                rows += list(range(6 * i, 6 * i + columns.stop - columns.start))
                sources += list(range(columns.start, columns.stop))
        covariance[np.ix_(rows, rows)] = self.covariance[np.ix_(sources, sources)]
        return covariance

    def lens_covariance(self, camera: str) -> Array:
        """Covariance of a lens's parameters, (4 + k, 4 + k); zero if the lens is fixed."""
        columns = self.problem.columns.get(camera)
        size = len(self.state.cameras[camera].parameters)
        return np.zeros((size, size)) if columns is None else self.covariance[columns, columns]


@limit_threads
def solve(cell: Cell, recording: Recording, settings: Settings = STATED) -> Solution:
    """Estimate all unknowns of a cell from a recording by maximum likelihood.

    Args:
        cell: Robots, cameras and targets, with all that is known of them.
        recording: Robot states and observations; clocks are as stated, or as guessed.
        settings: Settings of the solver.

    Raises:
        NotObservable: if the recording has no views that could be solved for.
        InputError: if an argument has the wrong type, or the cell contradicts the recording.
    """
    check_recording(cell, recording)
    check_type("settings", settings, Settings)
    problem, findings = build_problem(cell, synchronous_recording(cell, recording))
    return solve_problem(problem, cell, settings, tuple(findings))


def solve_problem(
    problem: Problem,
    cell: Cell,
    settings: Settings = STATED,
    findings: tuple[Finding, ...] = (),
) -> Solution:
    """Same as `solve`, for a problem already built."""
    with settings.stage("start"):
        problem, start, disputed = _start(problem, cell, settings)
    return replace(solve_from(problem, start, settings, findings), disputed=disputed)


def solve_from(
    problem: Problem,
    start: State,
    settings: Settings = STATED,
    findings: tuple[Finding, ...] = (),
) -> Solution:
    """Same as `solve_problem`, from a given initial state."""
    solution = solve_at_mode(problem, start, settings, findings)
    with settings.stage("noise"):
        return integrate_solution(solution)


def integrate_solution(solution: Solution, is_quick: bool = False, guess: NoiseEstimate | None = None) -> Solution:
    """Return a solution whose covariance includes the uncertainty of jointly estimated sigmas.

    The solution stays unchanged if its sigmas were not estimated jointly.

    Args:
        solution: Solution at the most likely sigmas.
        is_quick: Whether a covariance accurate to 10 % is sufficient.
        guess: Integrated sigmas of nearly the same views, as the starting point.
    """
    noise = integrate_sigmas(solution.problem, solution.state, solution.noise, is_quick, guess)
    if noise.covariance is None:
        return solution
    observability = solution.observability
    at_mode = spectrum(linearise(solution.problem, solution.state).hessian).inverse
    # If only the noise model determines a direction, the data contain less information on it than the model assumes.
    sigma_covariance = observability.onto_informative @ (noise.covariance - at_mode) @ observability.onto_informative.T
    return replace(solution, noise=noise, covariance=observability.inverse + sigma_covariance)


def solve_at_mode(
    problem: Problem,
    start: State,
    settings: Settings,
    findings: tuple[Finding, ...] = (),
    guess: NoiseEstimate | None = None,
) -> Solution:
    """Same as `solve_from`, but with the covariance at the most likely sigmas.

    Args:
        problem: The problem.
        start: Initial state.
        settings: Settings of the solver.
        findings: Findings so far, to include in the solution.
        guess: Sigmas of nearly the same views, as the starting point.
    """
    dof = degrees_of_freedom(problem)
    if settings.robot_noise == "estimated":
        with settings.stage("noise"):
            problem, end, noise = estimate_jointly(problem, start, settings.iterations, guess, settings.report_progress)
    else:
        with settings.stage("descent"):
            end = bundle_adjust(problem, start, dof, settings.iterations)
        with settings.stage("noise"):
            problem, end, noise = estimate_noise(problem, end, settings.iterations)
    with settings.stage("observability"):
        observability = None
        if end.sparse is not None:
            observability = sparse_observability(problem, end.state, end.sparse, noise.factor)
        if observability is None:
            observability = analyse_observability(problem, end.state, end.normal.hessian, noise.factor)
    covariance = observability.inverse * min(noise.factor, _LARGEST_FACTOR)
    return Solution(problem, end.state, covariance, observability, noise, end.cost, dof, end.converged, findings)


def _start(problem: Problem, cell: Cell, settings: Settings) -> tuple[Problem, State, bool]:
    """Best initial state according to the settings.

    If the residuals of the closed-form start are implausible, other starts are tried.

    Returns:
        The problem with the chosen readings, the state of least cost, and whether the costs of the descents differ.
    """
    if settings.start == "guess":
        start = guessed_state(problem, cell)
        if start is None:
            raise InputError("start 'guess' needs a guess, a prior or a value for every transform of the cell")
    elif settings.start == "axis-shift":
        start = axis_shift_state(problem, cell)
    else:
        start = first_state(problem, cell, thorough=settings.start == "thorough")
    first = _choose_readings(problem, start, settings)
    if settings.start != "closed" or _is_plausible(problem, first[2]):
        return *first[:2], False
    others = [first_state(problem, cell, thorough=True), guessed_state(problem, cell), joint_state(problem, cell)]
    ends = [first, *(_choose_readings(problem, state, settings) for state in others if state is not None)]
    costs = np.array([np.inf if np.isnan(end[2]) else end[2] for end in ends])
    return *ends[int(np.argmin(costs))][:2], bool(costs.max() > costs.min() * (1 + SAME_COST))


def _choose_readings(problem: Problem, state: State, settings: Settings) -> tuple[Problem, State, float]:
    """Alternate descent and choice of readings; return the problem with its readings, the optimum and its cost."""
    dof = degrees_of_freedom(problem)
    problem, _ = choose_correspondence(problem, state)
    for _ in range(_MOST_READING_ROUNDS):
        end = bundle_adjust(problem, state, dof, settings.iterations)
        state = end.state
        problem, changed = choose_correspondence(problem, state)
        if not changed:
            break
    return problem, state, end.cost


def axis_shift_state(problem: Problem, cell: Cell) -> State:
    """State from the paper's closed form: known mounts, and the base as the mean of all stations.

    Raises:
        NotObservable: if there is no station, or a mount is not known.
        InputError: if a lens is not stated.
    """
    if any(lens.camera is None for lens in problem.lenses.values()):
        raise InputError("start 'axis-shift' needs the lens of every camera: state its intrinsics")
    cameras = lenses(problem, cell)
    stations = find_stations(problem, cameras)
    eye_base_from_hand_base = fuse_bases([s.base() for s in stations], [1.0] * len(stations))
    transforms = {name: unknown.mean or SE3.identity() for name, unknown in problem.unknowns.items()}
    group = next(g for g in problem.groups if (g.camera, g.target) == (stations[0].camera, stations[0].target))
    placed = group.placed_base(eye_base_from_hand_base, transforms, transforms)
    return State(transforms | placed, cameras, np.zeros((len(problem.stops), 6)))


def _is_plausible(problem: Problem, cost: float) -> bool:
    """Whether the residuals at the end of a descent are plausible: at most a few sigmas or pixels."""
    dof = degrees_of_freedom(problem)
    unstated = {f: n for f, n in residual_counts(problem).items() if f != "stated" and n}
    if not unstated:
        return cost < PLAUSIBLE_SIGMAS**2 * max(dof, 1)
    limits = Noise(PLAUSIBLE_PX, _PLAUSIBLE_M, _PLAUSIBLE_RAD, _PLAUSIBLE_M, PLAUSIBLE_TOUCH_M, _PLAUSIBLE_RAD)
    unit = Noise()
    worst = max(getattr(limits, f) / getattr(unit, f) for f in unstated)
    return cost < float(worst) ** 2 * max(dof, 1)
