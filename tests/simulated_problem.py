"""The problem of a simulated recording."""

from __future__ import annotations

from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem
from basecal.simulation import Scenario, simulate


def simulated_problem(scenario: Scenario, seed: int = 2) -> Problem:
    """Build the problem of a simulated cell and recording."""
    simulated = simulate(scenario, seed)
    return build_problem(simulated.cell, simulated.recording)[0]
