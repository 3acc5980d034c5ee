"""Calibrations a second of a Monte Carlo study: one structure, many draws of its noise, solved as a batch.

Each has 30 samples of a rigid target of 24 points, with both mounts and the base free and the covariance. Starts are
off by 2 mm and 2 mrad per axis. The time to draw the noise does not count. One process runs on each core. A few draws
are also solved one at a time by `solve_from`, and compared.
"""

from __future__ import annotations

import argparse
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np

from basecal.cell.targets.chessboard import chessboard_target
from basecal.estimation.least_squares.bundle_adjustment import batch_states
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import solve_from
from basecal.estimation.solve_batch import solve_batch
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from benchmarks.common import table, write

SCENARIO = Scenario(target="chessboard", board=chessboard_target((6, 4), 0.04), samples=30)
START_OFFSET = 2e-3  # of the starts from the truth, per axis [m, rad]
SIGMA_PX = 0.2
CHUNK = 256  # draws in a batch: more are not faster and take memory
COMPARED = 8  # draws of each batch that are solved separately too
HEAD = ("processes", "calibrations", "a second", "required", "largest difference from a separate solve")
ASKED = 4000.0


def draws(count: int, seed: int) -> tuple[Problem, State]:
    """One problem that holds a number of draws of the pixels' noise, and starts."""
    simulated = simulate(SCENARIO, seed=0)
    problem, _ = build_problem(simulated.cell, simulated.recording)
    rng = np.random.default_rng([seed, 1])
    group = problem.groups[0]
    measurement = group.measurement
    assert isinstance(measurement, PixelMeasurement)
    pixels = measurement.pixels + SIGMA_PX * rng.standard_normal((count, *measurement.pixels.shape))
    batch = problem.with_groups([replace(group, measurement=replace(measurement, pixels=pixels), readings=())])
    starts = [
        State(
            {name: simulated.truth[name] @ SE3.exp(START_OFFSET * rng.standard_normal(6)) for name in problem.unknowns},
            simulated.cameras,
            np.zeros((0, 6)),
        )
        for _ in range(count)
    ]
    return batch, batch_states(batch, starts)


def _one(group: ViewGroup, row: int) -> ViewGroup:
    """The views of one draw, without the batch axis."""
    measurement = group.measurement
    assert isinstance(measurement, PixelMeasurement)
    return replace(group, measurement=replace(measurement, pixels=measurement.pixels[row]))


def measure(seed: int, rounds: int) -> tuple[int, float, float]:
    """Number of draws solved, wall time [s], and the largest difference of the first few from a separate solve."""
    problem, starts = draws(CHUNK, seed)
    solution = solve_batch(problem, starts)
    assert solution.converged.all()
    largest = 0.0
    for row in range(COMPARED):
        alone = problem.with_groups([_one(problem.groups[0], row)])
        start = State({n: t[row] for n, t in starts.transforms.items()}, starts.cameras, np.zeros((0, 6)))
        own = solve_from(alone, start)
        for name, transform in own.state.transforms.items():
            largest = max(largest, float(np.abs(solution.state.transforms[name][row].matrix - transform.matrix).max()))
        scale = np.sqrt(np.diag(own.covariance))
        largest = max(
            largest, float(np.abs((solution.covariance[row] - own.covariance) / np.outer(scale, scale)).max())
        )
    begin = time.perf_counter()
    for _ in range(rounds):
        solve_batch(problem, starts)
    return CHUNK * rounds, time.perf_counter() - begin, largest


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table."""
    rate = f"{result['rate']:.0f}"
    return (str(result["processes"]), str(result["count"]), rate, f"{ASKED:.0f}", f"{result['worst']:.1e}")


def main() -> None:
    """Run it on one process and on all cores."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=40, help=f"how often each process solves {CHUNK} draws")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    results = []
    for processes in sorted({1, options.workers}):
        with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
            parts = list(pool.map(measure, range(processes), [options.rounds] * processes))
        count, seconds = sum(part[0] for part in parts), max(part[1] for part in parts)
        worst = max(part[2] for part in parts)
        results.append({"processes": processes, "count": count, "rate": count / seconds, "worst": worst})
    print(table(HEAD, map(row, results)))
    write("batch", {"rows": results})


if __name__ == "__main__":
    main()
