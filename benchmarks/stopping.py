"""As many samples as a plan says a goal needs: whether the goal is met, and whether fewer would have done.

Each cell has robots as noisy as drawn, between 0.03 and 0.15 mm, twice as many mrad, per axis and stop. For each goal
the samples that the plan asks for are recorded with noise of their own and solved: the true error at the task is to be
within the 95 % that the plan promised. The best plan is the smallest number of samples for which exchanges from random
starts, each until it rests, promise the goal. Goals that the plan calls out of reach of sixty samples count apart.
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
DRAWN = 300  # candidates of a cell
NOISE_M = (3e-5, 1.5e-4)  # least and most, log-uniform
TURN = 2.0  # [rad/m] of a stop's noise
LOW, HIGH, MOST_RATIO = 0.915, 0.98, 1.3
BEST_OF, BEST_STARTS = 20, 2  # one cell of so many has its best plan looked for, from so many random starts
HEAD = ("goal [mm]", "cells", "out of reach", "samples, median", "within the bound planned", "to the best plan, worst")


def measured(seed: int) -> list[dict[str, Any]]:
    """One cell: for each goal what was planned, and what came of it."""
    low, high = np.log(NOISE_M)
    sigma = float(np.exp(np.random.default_rng([seed, 11]).uniform(low, high)))
    of = planned_cell(20_000 + seed, (sigma, TURN * sigma), DRAWN)
    return [_goal(of, seed, goal) for goal in GOALS_MM]


def _goal(of: PlannedCell, seed: int, goal_mm: float) -> dict[str, Any]:
    goal_m = 1e-3 * goal_mm

    def enough(covariance: np.ndarray, _: int) -> bool:
        """Whether the goal is promised."""
        return of.expected_m(covariance) <= goal_m

    prospect = of.prospect
    chosen, reached = choose_fewest(prospect.roots, prospect.covariance, of.weight, MOST_SAMPLES, enough)
    told: dict[str, Any] = {"seed": seed, "goal_mm": goal_mm, "reached": reached, "needed": len(chosen)}
    if not reached:
        return told
    found = of.errors_m(chosen, 1, seed)
    told["within"] = bool(len(found)) and bool(found[0, 0] < of.expected_m(of.covariance(chosen)))
    if seed % BEST_OF == 0:
        told["best"] = _best(of, len(chosen), goal_m)
    return told


def _best(of: PlannedCell, count: int, goal_m: float) -> int:
    """The fewest samples that promise the goal, of plans by exchange until it rests."""
    while count > 1 and exhaustive(of, count - 1, count, BEST_STARTS) <= goal_m:
        count -= 1
    return count


def row(found: Sequence[dict[str, Any]], goal_mm: float | None) -> tuple[object, ...]:
    """A line of the table with `HEAD`; of all goals where None."""
    mine = [each for each in found if goal_mm in (None, each["goal_mm"])]
    met = [each for each in mine if each["reached"]]
    ratios = [each["needed"] / each["best"] for each in met if "best" in each]
    within = f"{100 * np.mean([each['within'] for each in met]):.1f} % of {len(met)}" if met else ""
    needed = f"{np.median([each['needed'] for each in met]):g}" if met else ""
    worst = f"{max(ratios):.2f} of {len(ratios)}" if ratios else ""
    return goal_mm or "all", len(mine), len(mine) - len(met), needed, within, worst


def rows(found: Sequence[dict[str, Any]]) -> list[tuple[object, ...]]:
    """Lines of the table with `HEAD`."""
    return [row(found, goal) for goal in (*GOALS_MM, None)]


def section(result: dict[str, Any]) -> str:
    """Of docs/benchmarks.md."""
    about = f"""\
A plan predicts how many samples a goal needs, and so many are taken. The noise of the robots is
{1e3 * NOISE_M[0]:g} to {1e3 * NOISE_M[1]:g} mm a stop. Is the true error within the 95 % bound of the plan? Required:

- the bound holds in {100 * LOW:g} to {100 * HIGH:g} % of cells;
- the plan has at most {MOST_RATIO:g} times the samples of the best plan by exhaustive exchange, which is searched in
  one of {BEST_OF} cells."""
    return f"{about}\n\n{table(HEAD, rows(result['rows']))}"


def main(arguments: Sequence[str]) -> None:
    """Draw and print; of all cells results/stopping.json too."""
    run_cells("stopping", arguments, CELLS, measured, lambda found: table(HEAD, rows(found)))


if __name__ == "__main__":
    main(sys.argv[1:])
