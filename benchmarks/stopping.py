"""Plans for a goal: whether the goal is met with the planned number of samples, and whether fewer are enough.

Each cell has robots with a noise between 0.03 and 0.15 mm, and twice as many mrad, per axis and stop. For each goal the
planned samples are recorded with independent noise and solved. The true error at the task must be within the 95 % bound
of the plan. The best plan is the smallest number of samples for which exchanges from random starts, each until
convergence, predict that the goal is reached. Goals that the plan cannot reach with sixty samples count separately.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from basecal.planning.choose import choose_fewest
from basecal.planning.plan import MOST_SAMPLES
from benchmarks.common import run_cells, table
from benchmarks.planned_cell import PlannedCell, exhaustive, planned_cell

CELLS = 400
GOALS_MM = (0.1, 0.2, 0.5, 1.0)
CANDIDATES = 300  # candidates of a cell
NOISE_M = (3e-5, 1.5e-4)  # least and most, log-uniform
TURN_RAD_PER_M = 2.0  # [rad/m] of a stop's noise
LOW, HIGH, MOST_RATIO = 0.915, 0.98, 1.3
BEST_OF, BEST_STARTS = 20, 2  # the best plan is searched in one of so many cells, from so many random starts
HEAD = ("goal [mm]", "cells", "out of reach", "samples, median", "within the bound planned", "to the best plan, worst")


def measure(seed: int) -> list[dict[str, Any]]:
    """Results of one cell for each goal."""
    low, high = np.log(NOISE_M)
    sigma = float(np.exp(np.random.default_rng([seed, 11]).uniform(low, high)))
    cell = planned_cell(20_000 + seed, (sigma, TURN_RAD_PER_M * sigma), CANDIDATES)
    return [_goal_row(cell, seed, goal) for goal in GOALS_MM]


def _goal_row(cell: PlannedCell, seed: int, goal_mm: float) -> dict[str, Any]:
    goal_m = 1e-3 * goal_mm

    def is_reached(covariance: np.ndarray, _: int) -> bool:
        """Whether the goal is predicted to be reached."""
        return cell.expected_m(covariance) <= goal_m

    prospect = cell.prospect
    chosen, reached = choose_fewest(prospect.roots, prospect.covariance, cell.weight, MOST_SAMPLES, is_reached)
    result: dict[str, Any] = {"seed": seed, "goal_mm": goal_mm, "reached": reached, "needed": len(chosen)}
    if not reached:
        return result
    errors = cell.errors_m(chosen, 1, seed)
    result["within"] = bool(len(errors)) and bool(errors[0, 0] < cell.expected_m(cell.covariance(chosen)))
    if seed % BEST_OF == 0:
        result["best"] = _best(cell, len(chosen), goal_m)
    return result


def _best(cell: PlannedCell, count: int, goal_m: float) -> int:
    """The fewest samples that reach the goal, over plans by exchange until convergence."""
    while count > 1 and exhaustive(cell, count - 1, count, BEST_STARTS) <= goal_m:
        count -= 1
    return count


def row(results: Sequence[dict[str, Any]], goal_mm: float | None) -> tuple[object, ...]:
    """A line of the table with `HEAD`; of all goals if `goal_mm` is None."""
    chosen = [each for each in results if goal_mm in (None, each["goal_mm"])]
    met = [each for each in chosen if each["reached"]]
    ratios = [each["needed"] / each["best"] for each in met if "best" in each]
    within = f"{100 * np.mean([each['within'] for each in met]):.1f} % of {len(met)}" if met else ""
    needed = f"{np.median([each['needed'] for each in met]):g}" if met else ""
    worst = f"{max(ratios):.2f} of {len(ratios)}" if ratios else ""
    return goal_mm or "all", len(chosen), len(chosen) - len(met), needed, within, worst


def rows(results: Sequence[dict[str, Any]]) -> list[tuple[object, ...]]:
    """Lines of the table with `HEAD`."""
    return [row(results, goal) for goal in (*GOALS_MM, None)]


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
A plan predicts how many samples a goal needs, and so many are taken. The noise of the robots is
{1e3 * NOISE_M[0]:g} to {1e3 * NOISE_M[1]:g} mm a stop. Is the true error within the 95 % bound of the plan? Required:

- the bound holds in {100 * LOW:g} to {100 * HIGH:g} % of cells;
- the plan has at most {MOST_RATIO:g} times the samples of the best plan by exhaustive exchange, which is searched in
  one of {BEST_OF} cells."""
    return f"{about}\n\n{table(HEAD, rows(result['rows']))}"


def main(arguments: Sequence[str]) -> None:
    """Draw and print; with all cells write results/stopping.json too."""
    run_cells("stopping", arguments, CELLS, measure, lambda found: table(HEAD, rows(found)))


if __name__ == "__main__":
    main(sys.argv[1:])
