"""Many robots: time and memory of a ring with loops, each robot seeing the next and the next but one.

Measured is the solution from the arrays of a recording to every base with its covariance relative to every other:
start, descent and covariance. Robots' noise is stated, and each sample is of one pair at new stops. The time is CPU
time on one thread.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
import tracemalloc
from typing import Any

import numpy as np

from basecal.cell.targets.charuco import charuco_target
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.start.first_state import first_state
from basecal.geometry import Array
from basecal.simulation import Scenario, SimulatedCell, simulate
from benchmarks.common import on_one_core, table, write
from benchmarks.scaling import slope

BY_ROBOTS = ((20, 2000), (40, 4000), (60, 6000), (100, 10_000))
BY_SAMPLES = ((100, 3000), (100, 10_000), (100, 30_000), (100, 100_000))
MOST_SECONDS, MOST_SLOPE = 5.0, 1.1
REPEATS = 3  # the fastest counts, since other programs use the machine too
HEAD = (
    "robots",
    "samples",
    "start [s]",
    "descent [s]",
    "steps",
    "covariance [s]",
    "all [s]",
    "peak [MB]",
    "largest error [mm]",
    "NEES/6",
)


def make_ring(robots: int, samples: int) -> SimulatedCell:
    """A ring of robots with 0.1 mm and 0.1 mrad of noise."""
    board = charuco_target((4, 4), 0.04, 0.03, "DICT_4X4_50")
    scenario = Scenario(layout="ring", robots=robots, samples=samples, board=board, robot_noise=(1e-4, 1e-4))
    return simulate(scenario, 1)


def base_columns(problem: Problem, names: list[str]) -> Array:
    """Columns of all bases."""
    return np.concatenate([np.arange(problem.columns[name].start, problem.columns[name].stop) for name in names])


def solve_bases(problem: Problem, start: State) -> tuple[State, Array]:
    """The optimum, and the joint covariance of all bases, which determines that of any relative to any other."""
    end = bundle_adjust(problem, start, degrees_of_freedom(problem))
    assert end.converged
    assert end.sparse is not None
    return end.state, end.sparse.inverse_block(base_columns(problem, base_names(problem)))


def base_names(problem: Problem) -> list[str]:
    """Names of the estimated bases."""
    return sorted({end.base for g in problem.groups for end in g.ends if end.base is not None})


def measure(robots: int, samples: int) -> dict[str, Any]:
    """A row: times [s], peak memory of descent and covariance [bytes], and errors of the bases."""
    simulated = make_ring(robots, samples)
    problem, _ = build_problem(simulated.cell, simulated.recording)
    names = base_names(problem)
    rounds = []
    for _ in range(REPEATS):
        times = [time.process_time()]
        start = first_state(problem, simulated.cell, thorough=False)
        times.append(time.process_time())
        end = bundle_adjust(problem, start, degrees_of_freedom(problem))
        times.append(time.process_time())
        assert end.converged
        assert end.sparse is not None
        covariance = end.sparse.inverse_block(base_columns(problem, names))
        times.append(time.process_time())
        rounds.append(np.diff(times))
    quickest = np.min(rounds, axis=0)
    errors = np.stack([(end.state.transforms[name].inverse() @ simulated.truth[name]).log() for name in names])
    nees = [e @ np.linalg.solve(covariance[6 * k : 6 * k + 6, 6 * k : 6 * k + 6], e) for k, e in enumerate(errors)]
    gc.collect()
    tracemalloc.start()
    held, _ = tracemalloc.get_traced_memory()
    solve_bases(problem, start)
    peak = tracemalloc.get_traced_memory()[1] - held
    tracemalloc.stop()
    parts = dict(zip(("start_s", "descent_s", "covariance_s"), quickest.tolist(), strict=True))
    return {
        "robots": robots,
        "samples": samples,
        **parts,
        "seconds": float(quickest.sum()),
        "iterations": end.iterations,
        "peak_bytes": peak,
        "largest_error_mm": float(1e3 * np.linalg.norm(errors[:, :3], axis=-1).max()),
        "nees_over_6": float(np.mean(nees) / 6),
    }


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    start, descent, *times = (f"{result[name]:.2f}" for name in ("start_s", "descent_s", "covariance_s", "seconds"))
    return (
        str(result["robots"]),
        f"{result['samples']:,}",
        *(start, descent, str(result["iterations"]), *times),
        f"{result['peak_bytes'] / 1e6:.0f}",
        f"{result['largest_error_mm']:.2f}",
        f"{result['nees_over_6']:.2f}",
    )


def slopes(by_robots: list[dict[str, Any]], by_samples: list[dict[str, Any]]) -> dict[str, float]:
    """Slopes of the logarithms of time and memory over robots, with as many samples each, and over samples alone."""
    parts = {"robots": by_robots, "samples": by_samples}
    return {
        f"{field} over {name}": slope(rows, field)
        for name, rows in parts.items()
        for field in ("seconds", "peak_bytes")
    }


def main(arguments: list[str]) -> None:
    """Measure, print; with all sizes write results/robots.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robots", description=__doc__)
    parser.add_argument("--largest", type=int, default=max(n for _, n in (*BY_ROBOTS, *BY_SAMPLES)), help="samples")
    largest = parser.parse_args(arguments).largest
    on_one_core()
    rows = [[measure(*size) for size in sizes if size[1] <= largest] for sizes in (BY_ROBOTS, BY_SAMPLES)]
    print(table(HEAD, map(row, [*rows[0], *rows[1]])))
    result = {"by_robots": rows[0], "by_samples": rows[1], "slopes": slopes(*rows)}
    print(result["slopes"])
    if [len(part) for part in rows] == [len(BY_ROBOTS), len(BY_SAMPLES)]:
        write("robots", result)


if __name__ == "__main__":
    main(sys.argv[1:])
