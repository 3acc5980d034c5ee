"""Command: python -m benchmarks.solve."""

from __future__ import annotations

import argparse
import gc
import sys
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import solve_from
from basecal.estimation.start.first_state import first_state
from benchmarks.common import interleave_times, on_one_core, table, write
from benchmarks.solve import by_ceres, by_gtsam, by_scipy
from benchmarks.solve.outcome import Outcome
from benchmarks.solve.task import Task, make_task

OURS, START = "basecal", "basecal, closed-form start"
COST_AGREES, SPREAD_AGREES = 1e-6, 1e-3


def _ours(problem: Problem, start: State) -> Callable[[], Outcome]:
    def work() -> Outcome:
        solution = solve_from(problem, start)
        return Outcome(solution.cost, solution.state, solution.covariance, 0)

    return work


def _works(task: Task) -> dict[str, Callable[[], Outcome]]:
    arguments = task.problem, task.start
    peers = {**by_scipy.solvers(*arguments), **by_gtsam.solvers(*arguments), **by_ceres.solvers(*arguments)}
    return {OURS: _ours(*arguments), **peers}


def check(works: dict[str, Callable[[], Outcome]]) -> dict[str, dict[str, float]]:
    """Assert that all have the same cost and covariance, and return the differences from ours."""
    ends = {name: work() for name, work in works.items()}
    ours = ends[OURS]
    out = {}
    for name, end in ends.items():
        cost = abs(end.cost / ours.cost - 1)
        spread = float(np.abs(end.covariance - ours.covariance).max() / np.abs(ours.covariance).max())
        assert cost < COST_AGREES, f"{name}: cost differs by {cost:.2g}"
        assert spread < SPREAD_AGREES, f"{name}: covariance differs by {spread:.2g}"
        out[name] = {"cost_differs": cost, "covariance_differs": spread, "evaluations": end.evaluations}
    return out


def measure(task: Task, repeats: int) -> dict[str, Any]:
    """Times of all solvers, and ratios to ours."""
    works = _works(task)
    agreement = check(works)
    all_works: dict[str, Callable[[], object]] = dict(works)
    all_works[START] = lambda: first_state(task.problem, task.cell, thorough=False)
    gc.disable()
    times = interleave_times(all_works, repeats)
    gc.enable()
    medians = {name: 1e3 * median(each) for name, each in times.items()}
    peers = {name: ms for name, ms in medians.items() if name not in (OURS, START)}
    fastest = min(peers, key=lambda name: peers[name])
    return {
        "samples": len(task.problem.groups[0]),
        "repeats": repeats,
        "median_ms": medians,
        "least_ms": {name: 1e3 * min(each) for name, each in times.items()},
        "agreement": agreement,
        "fastest_peer": fastest,
        "times_faster_than_fastest_peer": peers[fastest] / medians[OURS],
        "start_over_solve": medians[START] / medians[OURS],
    }


def _report(result: dict[str, Any]) -> str:
    ours = result["median_ms"][OURS]
    rows = []
    for name, ms in sorted(result["median_ms"].items(), key=lambda item: item[1]):
        same = result["agreement"].get(name, {})
        cost = f"{same['cost_differs']:.0e}" if same else ""
        rows.append((name, f"{ms:.2f}", f"{result['least_ms'][name]:.2f}", f"{ms / ours:.2f}", cost))
    text = table(("solver", "median [ms]", "least [ms]", "over ours", "cost differs by"), rows)
    faster, start = result["times_faster_than_fastest_peer"], result["start_over_solve"]
    return f"{text}\n\nFastest peer: {result['fastest_peer']}, {faster:.2f} times ours. Start over solve: {start:.2f}."


def main(arguments: list[str]) -> None:
    """Measure, print, write results/solve.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.solve", description=__doc__)
    parser.add_argument("--samples", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=25, help="rounds; each runs every solver once (default 25)")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args(arguments)
    on_one_core()
    with threadpool_limits(1):
        result = measure(make_task(asked.samples, asked.seed), asked.repeats)
    print(_report(result))
    print(f"\nwritten: {write('solve', {'seed': asked.seed, **result}).name}")


if __name__ == "__main__":
    main(sys.argv[1:])
