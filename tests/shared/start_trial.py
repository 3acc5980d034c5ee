"""One cell solved without a guess and from the truth."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import Solution, solve_from, solve_problem
from basecal.simulation import simulate
from tests.shared.kinds import kind_scenario

SAME_M_RAD = 1e-6
SAME_COST = 1e-9


class Trial(NamedTuple):
    """One cell: `same`, `other` or `unseen`; costs without a guess and from the truth; seconds without a guess."""

    kind: str
    seed: int
    samples: int
    verdict: str
    cost: float
    cost_from_truth: float
    off: float
    seconds: float


def _largest_difference(a: Solution, b: Solution) -> float:
    """Largest difference of a transform's tangent between two solutions [m, rad]."""
    names = set(a.state.transforms)
    return max(float(np.abs((a.state.transforms[n].inverse() @ b.state.transforms[n]).log()).max()) for n in names)


def trial(kind: str, seed: int) -> Trial:
    """Solve one cell twice."""
    scenario = kind_scenario(kind, seed)
    simulated = simulate(scenario, seed)
    problem, _ = build_problem(simulated.cell, simulated.recording)
    truth = State(simulated.truth, simulated.cameras if problem.lenses else {}, np.zeros((len(problem.stops), 6)))
    best = solve_from(problem, truth)
    began = time.perf_counter()
    solution = solve_problem(problem, simulated.cell)
    took = time.perf_counter() - began
    off = _largest_difference(solution, best)
    converged = solution.converged and best.converged and np.isfinite(solution.cost)
    same = converged and (off < SAME_M_RAD or solution.cost <= best.cost * (1 + SAME_COST))
    verdict = "unseen" if best.observability.null_space else "same" if same else "other"
    return Trial(kind, seed, scenario.samples, verdict, solution.cost, best.cost, off, took)
