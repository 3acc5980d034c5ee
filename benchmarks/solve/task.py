"""The task: 200 samples of 36 points, three free mounts, a start near the answer."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Cell
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


@dataclass(frozen=True, eq=False)
class Task:
    """A packed problem and a start.

    Attributes:
        cell: The simulated cell.
        problem: The packed arrays that all solvers are given.
        start: State that is a few millimetres and milliradians off the truth.
    """

    cell: Cell
    problem: Problem
    start: State


def make_task(samples: int, seed: int, offset: float = 2e-3) -> Task:
    """A dual-arm cell with a 6 x 6 board and 5 distortion terms, 0.2 px; the start is off by `offset` [m, rad]."""
    simulated = simulate(Scenario(samples=samples, target="chessboard", pixel_px=0.2), seed)
    problem, _ = build_problem(simulated.cell, simulated.recording)
    rng = np.random.default_rng(seed)
    start = {name: simulated.truth[name] @ SE3.exp(offset * rng.standard_normal(6)) for name in problem.unknowns}
    return Task(simulated.cell, problem, State(start, simulated.cameras, np.zeros((0, 6))))


def move_start(start: State, names: tuple[str, ...], step: np.ndarray) -> State:
    """The start changed on the right by (6 n,) tangents of the named transforms."""
    transforms = {
        name: start.transforms[name] @ SE3.exp(xi) for name, xi in zip(names, step.reshape(-1, 6), strict=True)
    }
    return replace(start, transforms={**start.transforms, **transforms})
