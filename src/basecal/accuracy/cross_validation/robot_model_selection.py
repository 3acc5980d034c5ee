"""Selection of a model for errors of robots' kinematics, by held-out samples.

The choice is the simplest model such that no other model predicts held-out stations significantly better; see
`model_comparison`. The noise of robots is marginalised view by view.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.cross_validation.folds import FOLDS, Split, place_split, splits
from basecal.accuracy.cross_validation.station_scores import score_stations
from basecal.accuracy.model_comparison.held_out import compare_predicted_gains
from basecal.accuracy.model_comparison.nested_models import Comparison, Decision
from basecal.cell import Parameters
from basecal.effects import joint_offsets, link_parameters
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.outliers.inlier_mask import select_samples
from basecal.estimation.problem.build import free_ends, recorded_by_joints, recorded_joints
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.robot_parameters import RobotModel, robot_model
from basecal.estimation.settings import STATED, Settings
from basecal.estimation.solve import Solution, solve_from
from basecal.geometry import Array
from basecal.kinematics import SerialChain
from basecal.numerics.spectral import spectrum

_FEWEST_VIEWS = 15  # with fewer, a held-out fifth is two views; assumed
_MOST_SAMPLES = 200  # about as many, evenly chosen, are enough to distinguish models; bounds the time
# Single joints with the largest gain: if one joint is wrong alone, it is the first of them; assumed, bounds the time.
_JOINTS_TRIED = 3
_LEAST_GAIN = 6.0  # standard deviations by which the decrease of the cost must exceed its expectation by chance

OFFSETS, LINKS = joint_offsets.NAME, link_parameters.NAME
_OFFSET_PRIORS: dict[str, Parameters] = {
    OFFSETS: joint_offsets.Stated(status="prior", sigma_rad=joint_offsets.SIGMA_RAD)
}
_ALL_PRIORS: dict[str, Parameters] = {
    **_OFFSET_PRIORS,
    LINKS: link_parameters.Stated(status="prior", sigma_rad=link_parameters.SIGMA_RAD, sigma_m=link_parameters.SIGMA_M),
}

Models = Mapping[str, RobotModel]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A model of the robots, and its prediction of held-out stations.

    Attributes:
        kind: `none`, `joint`, `offsets` or `links`.
        robots: Names of the robots with estimated kinematics.
        joint: Number of the only estimated joint, from 0; None unless `kind` is `joint`.
        scores: (n,) score of each held-out station; see `StationScores`.
        error_m: Rms distance between predicted and observed target [m]; None if a view has neither pose nor point.
        rms: Root mean square of residuals over sigmas.
    """

    kind: str
    robots: tuple[str, ...]
    joint: int | None
    scores: Array
    error_m: float | None
    rms: float


@dataclass(frozen=True, eq=False)
class RobotModelChoice:
    """The model of the robots that is selected by held-out samples.

    Attributes:
        chosen: The simplest model such that no other model predicts significantly better.
        better: A richer model that may be better; None if the choice is clear.
        candidates: All tried models, the simplest first.
        solution: The solution of all data with `chosen`.
    """

    chosen: Candidate
    better: Candidate | None
    candidates: tuple[Candidate, ...]
    solution: Solution


def choose_robot_model(solution: Solution, settings: Settings = STATED) -> RobotModelChoice | None:
    """Select the model of the robots by held-out samples.

    Args:
        solution: The solution with the stated robot kinematics.
        settings: Settings of the solver.

    Returns:
        The choice, or None if no choice is possible. That holds if no robot is recorded by joints, if kinematics are
        already estimated, or if the solution has not converged. It also holds for fewer than 15 views or five stations,
        or if estimating all offsets and links hardly lowers the cost.
    """
    recorded = [r for r in solution.problem.robots if recorded_by_joints(solution.problem, r)]
    chains = {r: solution.problem.chains[r] for r in recorded if r in solution.problem.chains}
    views = sum(map(len, solution.problem.groups))
    if solution.problem.models or not chains or views < _FEWEST_VIEWS or not solution.converged:
        return None
    numbers = solution.problem.samples
    problem = select_samples(solution.problem, numbers[:: -(-len(numbers) // _MOST_SAMPLES)])
    models = _models(problem, chains, tuple(chains), _ALL_PRIORS)
    richest = solve_from(problem.with_models(models), solution.state, settings)
    problem = problem.with_noise(richest.noise.noise)
    by_stations = (split for split in splits(problem) if len(split.parts) >= FOLDS)
    split = place_split(problem) or next(by_stations, None)
    if split is None:
        return None
    plain = bundle_adjust(problem, solution.state, degrees_of_freedom(problem), settings.iterations)
    if not _is_promising(plain.cost, richest, richest.problem.width - problem.width):
        return None
    candidates = _Trials(problem, chains, plain.state, split, settings.iterations).candidates()
    best = min(candidates, key=_mean_score)
    comparisons = [_compare(best, each) for each in candidates]
    chosen, compared = next(pair for pair in zip(candidates, comparisons, strict=True) if not pair[1].is_taken)
    better = best if compared.decision is Decision.UNDECIDED else None
    whole = solution.problem.with_noise(richest.noise.noise)
    solved = solve_from(whole.with_models(_candidate_models(whole, chains, chosen)), solution.state, settings)
    return RobotModelChoice(chosen, better, tuple(candidates), solved)


def _is_promising(cost: float, richest: Solution, columns: int) -> bool:
    """Whether the richest model lowers the cost by significantly more than chance, given its additional columns."""
    scale = max(richest.cost / max(richest.dof, 1), 1e-12)
    return bool(cost - richest.cost > (columns + _LEAST_GAIN * np.sqrt(2 * columns)) * scale)


def _models(
    problem: Problem,
    chains: Mapping[str, SerialChain],
    robots: tuple[str, ...],
    statements: Mapping[str, Parameters],
    joint: int | None = None,
) -> Models:
    models = {
        r: robot_model(r, chains[r], statements, recorded_joints(problem, r), free_ends(problem, r)) for r in robots
    }
    return models if joint is None else {r: model.select_joint(OFFSETS, joint) for r, model in models.items()}


def _candidate_models(problem: Problem, chains: Mapping[str, SerialChain], candidate: Candidate) -> Models:
    stated = _ALL_PRIORS if candidate.kind == "links" else _OFFSET_PRIORS
    return _models(problem, chains, candidate.robots, stated, candidate.joint)


@dataclass(frozen=True, eq=False)
class _Trials:
    """Common data of all trials: the problem without robot models, its chains, its optimum, and the folds."""

    problem: Problem
    chains: Mapping[str, SerialChain]
    state: State
    split: Split
    iterations: int

    def candidates(self) -> list[Candidate]:
        """Candidate models, the simplest first: none, single joints, offsets of one robot, all offsets, all links.

        Single joints and single robots are tried only if all offsets or links may predict better than none.
        """
        robots = tuple(self.chains)
        none, offsets, links = self.score("none", ()), self.score("offsets", robots), self.score("links", robots)
        best = min(offsets, links, key=_mean_score)
        found = [none]
        if _compare(best, none).decision is not Decision.KEEP:
            joints = (self.score("joint", (robot,), joint) for robot, joint in self.likeliest_joints())
            found += sorted(joints, key=_mean_score)
            if len(robots) > 1:
                found += sorted((self.score("offsets", (robot,)) for robot in robots), key=_mean_score)
        return [*found, offsets, links]

    def observable_joints(self, robot: str) -> list[int]:
        """Numbers of a robot's joints whose offsets are observable with the other unknowns."""
        free = _models(self.problem, self.chains, (robot,), {OFFSETS: joint_offsets.Stated(status="free")})[robot]
        return free.columns[OFFSETS].basis.argmax(axis=0).tolist() if OFFSETS in free.columns else []

    def likeliest_joints(self) -> list[tuple[str, int]]:
        """Robots and joints whose single offsets lower the cost most, to second order about the stated kinematics."""
        stated = _models(self.problem, self.chains, tuple(self.chains), _OFFSET_PRIORS)
        modelled = self.problem.with_models(stated)
        normal = linearise(modelled, self.state)
        own = np.arange(self.problem.width)
        back = normal.hessian[:, own] @ spectrum(normal.hessian[np.ix_(own, own)]).inverse
        gradient = normal.gradient - back @ normal.gradient[own]
        left = np.diag(normal.hessian - back @ normal.hessian[own])
        decreases: dict[tuple[str, int], float] = {}
        for robot in self.chains:
            first = modelled.columns[f"{robot}_{OFFSETS}"].start
            decreases |= {(robot, j): gradient[first + j] ** 2 / left[first + j] for j in self.observable_joints(robot)}
        return sorted(decreases, key=lambda joint: -decreases[joint])[:_JOINTS_TRIED]

    def score(self, kind: str, robots: tuple[str, ...], joint: int | None = None) -> Candidate:
        """Score a model by its prediction of held-out stations."""
        candidate = Candidate(kind, robots, joint, np.zeros(0), None, 0.0)
        modelled = self.problem.with_models(_candidate_models(self.problem, self.chains, candidate))
        station_scores = score_stations(modelled, self.state, self.split, self.iterations)
        has_error = len(station_scores.distance_m) and np.all(np.isfinite(station_scores.distance_m))
        error_m = float(np.sqrt(np.mean(station_scores.distance_m**2))) if has_error else None
        return replace(
            candidate,
            scores=station_scores.scores,
            error_m=error_m,
            rms=float(np.sqrt(max(station_scores.mean_square, 0.0))),
        )


def _mean_score(candidate: Candidate) -> float:
    return float(candidate.scores.mean())


def _compare(rival: Candidate, candidate: Candidate) -> Comparison:
    """Compare a rival with a candidate: it is taken if it predicts better."""
    return compare_predicted_gains(candidate.scores - rival.scores)
