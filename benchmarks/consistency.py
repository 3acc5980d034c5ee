"""Whether covariances are true: squared errors of the base in its own covariance, over simulated cells.

With xi the error of the base and C its covariance, xi' C^-1 xi is chi-square with 6 degrees of freedom (NEES). NEES / 6
then has the mean 1. Over 2,000 cells there are 12,000 degrees of freedom, and the standard error of the mean is
sqrt(2 / 12,000) = 0.0129. The band [0.955, 1.046] is 3.5 standard errors to either side, left by chance once in 2,150
times. Fewer cells have a wider band with the same probability.

Beside it, the root mean square of the base's errors is given, each over the Cramer-Rao bound of its own cell. The bound
is the inverse of the information at the truth, with the priors (Van Trees 1968). No estimator without bias is below.
A scenario is well-posed if in 99 of 100 cells the bound itself gives the base no sigma above 10 mm or 10 mrad. In this
range the error of a rotation is small beside one. This depends on the bound alone, not on the errors.

Estimated sigmas make errors larger by nu / (nu - 2), with nu the degrees of freedom of the covariance. This is exact if
one factor is the only unknown. If robots' noise is estimated too, it is Satterthwaite's approximation.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
from scipy.stats import chi2
from tests.shared.consistency_trial import (
    ESTIMATED,
    FAR_QUANTILE,
    FREEDOMS,
    SCENARIOS,
    SMALL_M,
    SMALL_RAD,
    Error,
    band,
    base_error,
)

from benchmarks.common import label, table, write

MOST = 1.05
ERRORS = 3.5

# The likelihood of robots' noise takes a hundred times as long as a solution.
CELLS_OF_ROBOTS = 100


def summary(name: str, errors: list[Error]) -> dict[str, Any]:
    """Statistics of a scenario; cells whose base is unobservable are counted, and are in no mean of NEES."""
    every = np.array([e.nees for e in errors])
    nees = every[np.isfinite(every)]
    mean = float(nees.mean()) / FREEDOMS
    low, high = band(len(nees))
    return {
        "scenario": name,
        "cells": len(errors),
        "mean": mean,
        "standard_error": float(nees.std(ddof=1)) / FREEDOMS / np.sqrt(len(nees)),
        "beyond_99": float(np.mean(nees > chi2.ppf(FAR_QUANTILE, FREEDOMS))),
        "worst": float(nees.max()),
        "unseen": len(every) - len(nees),
        "not_converged": sum(not e.converged for e in errors),
        "median_ms": 1e3 * float(np.median([e.seconds for e in errors])),
        "inside": low <= mean <= high,
        **_efficiency(errors),
    }


def _efficiency(errors: list[Error]) -> dict[str, Any]:
    """Rms errors of shift and turn, and whitened, over the bound, and whether the bound itself is small.

    Each cell has its own bound: cells differ, and the worst of them would otherwise dominate.
    """
    shift, turn = np.sqrt(np.mean([np.divide(e.squared, e.bound) for e in errors], axis=0))
    largest = np.quantile([e.largest for e in errors], 0.99, axis=0)
    return {
        "shift_over_bound": float(shift),
        "turn_over_bound": float(turn),
        "over_bound": float(np.sqrt(np.mean([e.nees_by_bound for e in errors]) / FREEDOMS)),
        "bound_mm": 1e3 * float(largest[0]),
        "bound_mrad": 1e3 * float(largest[1]),
        "well_posed": bool(largest[0] <= SMALL_M and largest[1] <= SMALL_RAD),
    }


def estimated_summary(name: str, errors: list[Error]) -> dict[str, Any]:
    """Statistics of a scenario whose sigmas are estimated: NEES beside its theory.

    Errors in an estimated covariance have heavier tails than chi-square, so that their empirical standard error counts.
    """
    theory = float(np.median([e.inflation for e in errors]))
    statistics = summary(name, errors)
    sigmas = np.array([e.robots for e in errors if e.robots is not None]).reshape(-1, 2)
    robot_sigmas = (
        {} if not len(sigmas) else {"robots": sigmas.mean(0).tolist(), "robots_scatter": sigmas.std(0).tolist()}
    )
    return (
        statistics
        | robot_sigmas
        | {
            "theory": theory,
            "found": len(sigmas),
            "inside": bool(abs(statistics["mean"] - theory) <= ERRORS * statistics["standard_error"]),
        }
    )


def run(names: Iterable[str], cells: int, first_seed: int, pool: Executor) -> Iterator[dict[str, Any]]:
    """Summaries of scenarios in turn, with the seconds that each took."""
    for name in names:
        began = time.perf_counter()
        scenario = SCENARIOS.get(name) or ESTIMATED[name]
        count = cells if scenario.state_robot_noise else min(cells, CELLS_OF_ROBOTS)
        seeds = range(first_seed, first_seed + count)
        errors = list(pool.map(base_error, [scenario] * count, seeds, chunksize=25))
        statistics = summary(name, errors) if name in SCENARIOS else estimated_summary(name, errors)
        yield {**statistics, "seconds": time.perf_counter() - began}


_NUMBERS = ("mean NEES / 6", "standard error", "beyond 99 %", "worst NEES")
_BOUND_RATIOS = ("translation / bound", "rotation / bound", "whitened / bound", "well-posed")
HEAD = ("scenario", *_NUMBERS, "unobservable", "not converged", *_BOUND_RATIOS, "inside")
ESTIMATED_HEAD = ("scenario", "cells", "mean NEES / 6", "standard error", "theory", "estimated sigmas", "inside")


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    numbers = f"{result['mean']:.3f}", f"{result['standard_error']:.3f}", f"{100 * result['beyond_99']:.2f} %"
    counts = f"{result['worst']:.1f}", str(result["unseen"]), str(result["not_converged"])
    ratios = [f"{result[key]:.3f}" for key in ("shift_over_bound", "turn_over_bound", "over_bound")]
    posed = "yes" if result["well_posed"] else "no"
    return (label(result["scenario"]), *numbers, *counts, *ratios, posed, "yes" if result["inside"] else "NO")


def estimated_row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `ESTIMATED_HEAD`."""
    numbers = f"{result['mean']:.3f}", f"{result['standard_error']:.3f}", f"{result['theory']:.3f}"
    sigmas = ""
    if "robots" in result:
        (shift, turn), (shift_scatter, turn_scatter) = result["robots"], result["robots_scatter"]
        sigmas = f"{1e3 * shift:.3f} +- {1e3 * shift_scatter:.3f} mm, {1e3 * turn:.3f} +- {1e3 * turn_scatter:.3f} mrad"
    return (label(result["scenario"]), str(result["cells"]), *numbers, sigmas, "yes" if result["inside"] else "NO")


def main(arguments: list[str]) -> None:
    """Run, print; with all scenarios write results/consistency.json too, after each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.consistency", description=__doc__)
    parser.add_argument("--cells", type=int, default=2000, help="of each scenario (default 2000)")
    every = [*SCENARIOS, *ESTIMATED]
    parser.add_argument("--scenarios", nargs="*", default=every, choices=every, metavar="NAME")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args(arguments)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    results: list[dict[str, Any]] = []
    with ProcessPoolExecutor(asked.workers, mp_context=get_context("spawn")) as pool:
        for each in run(asked.scenarios, asked.cells, asked.first_seed, pool):
            results.append(each)
            print(f"{each['seconds']:5.0f} s  {each['mean']:.3f}  {each['scenario']}", flush=True)
            if asked.scenarios == every:
                settings = {"cells": asked.cells, "first_seed": asked.first_seed, "band": band(asked.cells)}
                write("consistency", {**settings, **_by_table(results)})
    tables = _by_table(results)
    print("\n" + table(HEAD, map(row, tables["scenarios"])))
    print("\n" + table(ESTIMATED_HEAD, map(estimated_row, tables["estimated"])))


def _by_table(results: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    return {
        "scenarios": [each for each in results if each["scenario"] in SCENARIOS],
        "estimated": [each for each in results if each["scenario"] in ESTIMATED],
    }


if __name__ == "__main__":
    main(sys.argv[1:])
