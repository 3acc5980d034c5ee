"""Planned samples against random feasible ones: the true error at a task, on simulated cells, and the time to choose.

Planned and random samples come from the same candidates, are recorded with independent noise, and are solved. The true
error is that of the task's point by the solved base. The cells are those of `benchmarks.planned_cell`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.common import cpu_seconds, on_one_core, table, write
from benchmarks.planned_cell import CANDIDATES, STARTS, exhaustive, planned_cell

CELLS = 30
PLANNED, MORE_RANDOM = 12, 30
DRAWS = 15  # recordings of the planned samples, and random sets of each size
LARGE = 5000
MOST_RATIO, MOST_TO_BEST, MOST_S = 0.65, 1.1, 3.0
HEAD = ("what", "value", "required")


def measure(seed: int) -> dict[str, Any]:
    """Row of one cell: true errors [m] of planned, random and more random samples, and how good the bounds are."""
    cell, rng = planned_cell(seed), np.random.default_rng([seed, 9])
    chosen, covariance = cell.choose(PLANNED)
    error, bound = cell.errors_m(chosen, DRAWS, seed).T
    few, many = (
        np.concatenate([cell.errors_m(cell.random(count, rng), 1, 100 * seed + k)[:, 0] for k in range(DRAWS)])
        for count in (PLANNED, MORE_RANDOM)
    )
    predicted = cell.expected_m(covariance)
    return {
        "seed": seed,
        "planned_m": float(np.median(error)),
        "random_m": float(np.median(few)),
        "more_random_m": float(np.median(many)),
        "within_solved": float(np.mean(error < bound)),
        "within_planned": float(np.mean(error < predicted)),
        "to_best": predicted / exhaustive(cell, PLANNED, seed),
    }


def rows(result: dict[str, Any]) -> list[tuple[object, ...]]:
    """Lines of the table with `HEAD`."""
    values = {key: np.array([each[key] for each in result["cells"]]) for key in result["cells"][0]}
    median = {name: float(np.median(values[name])) for name in ("planned_m", "random_m", "more_random_m")}
    return [
        ("cells", len(result["cells"]), ""),
        (f"{PLANNED} planned, true error, median [mm]", f"{1e3 * median['planned_m']:.3f}", ""),
        (f"{PLANNED} random [mm]", f"{1e3 * median['random_m']:.3f}", ""),
        (f"{MORE_RANDOM} random [mm]", f"{1e3 * median['more_random_m']:.3f}", ""),
        (f"{PLANNED} planned to {PLANNED} random", f"{median['planned_m'] / median['random_m']:.3f}", MOST_RATIO),
        (
            "the same, median of the cells' ratios",
            f"{np.median(values['planned_m'] / values['random_m']):.3f}",
            MOST_RATIO,
        ),
        (f"{PLANNED} planned to {MORE_RANDOM} random", f"{median['planned_m'] / median['more_random_m']:.3f}", 1),
        ("the same, median of the cells' ratios", f"{np.median(values['planned_m'] / values['more_random_m']):.3f}", 1),
        ("true errors within the 95 % of the solution", f"{values['within_solved'].mean():.3f}", ""),
        ("true errors within the 95 % that was planned", f"{values['within_planned'].mean():.3f}", ""),
        ("planned 95 % to that of exhaustive exchange, worst", f"{values['to_best'].max():.3f}", MOST_TO_BEST),
        (f"{PLANNED} of {result['candidates']} candidates chosen [s of one core]", f"{result['choose_s']:.2f}", MOST_S),
    ]


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
{PLANNED} samples are planned from {CANDIDATES} candidates near nine taught poses, with bases and mounts guessed
within 5 mm and 1 degree. They are compared with random sets of the same candidates, by the true error of the solution
at a task half way between the bases. Exhaustive exchange has {STARTS} random starts and the greedy one, each until
convergence."""
    return f"{about}\n\n{table(HEAD, rows(result))}"


def main(arguments: Sequence[str]) -> None:
    """Draw and print; with all cells write results/plan.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.plan", description=__doc__)
    parser.add_argument("--cells", type=int, default=CELLS)
    asked = parser.parse_args(arguments)
    on_one_core()
    cells = [measure(seed) for seed in range(asked.cells)]
    large = planned_cell(0, count=LARGE)
    took = min(cpu_seconds(lambda: large.choose(PLANNED)) for _ in range(3))
    result = {"cells": cells, "candidates": len(large.prospect.samples), "choose_s": took}
    print(table(HEAD, rows(result)))
    if asked.cells >= CELLS:
        write("plan", result)


if __name__ == "__main__":
    main(sys.argv[1:])
