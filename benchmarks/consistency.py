"""Whether the covariance tells the truth: errors of the base, squared and weighed by it, over simulated cells.

With xi the error of the base and C its covariance, xi' C^-1 xi is chi-square with 6 degrees of freedom (NEES), so that
NEES / 6 has the mean 1. Over 2,000 cells there are 12,000 degrees of freedom: the mean's standard error is
sqrt(2 / 12,000) = 0.0129, and the band [0.955, 1.046] is 3.5 of them to either side, left by chance once in 2,150
times. Fewer cells have a wider band, by the same chance.

Beside it, the root mean square of the base's errors, each over its own cell's Cramer-Rao bound: the inverse of the
information at the truth, priors among it (Van Trees 1968), which no estimator without bias goes below. A scenario is
well-posed where in 99 of 100 cells the bound itself leaves the base no sigma above 10 mm or 10 mrad: the range where a
rotation's error is small beside one; that is said of the bound alone, before any error is looked at.

Sigmas that are estimated make errors larger by nu / (nu - 2) with nu the degrees of freedom of the covariance, exactly
where one factor is all that is unknown, by Satterthwaite's approximation where robots' noise is estimated too.
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
    BEYOND,
    ESTIMATED,
    FREEDOMS,
    SCENARIOS,
    SMALL_M,
    SMALL_RAD,
    Error,
    band,
    error_of,
)

from benchmarks.common import label, table, write

MOST = 1.05
ERRORS = 3.5


# The likelihood of robots' noise takes a hundred times as long as a solution.
CELLS_OF_ROBOTS = 100


def summary(name: str, errors: list[Error]) -> dict[str, Any]:
    """Statistics of a scenario; cells whose base is not seen are counted, and in no mean of NEES."""
    every = np.array([e.nees for e in errors])
    nees = every[np.isfinite(every)]
    mean = float(nees.mean()) / FREEDOMS
    low, high = band(len(nees))
    return {
        "scenario": name,
        "cells": len(errors),
        "mean": mean,
        "standard_error": float(nees.std(ddof=1)) / FREEDOMS / np.sqrt(len(nees)),
        "beyond_99": float(np.mean(nees > chi2.ppf(BEYOND, FREEDOMS))),
        "worst": float(nees.max()),
        "unseen": len(every) - len(nees),
        "not_converged": sum(not e.converged for e in errors),
        "median_ms": 1e3 * float(np.median([e.seconds for e in errors])),
        "inside": low <= mean <= high,
        **_efficiency(errors),
    }


def _efficiency(errors: list[Error]) -> dict[str, Any]:
    """Rms errors over the bound's, of shift and turn and whitened, and whether they must be small.

    Each cell by its own bound: cells differ, and the worst of them would else be all that is looked at.
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
    """Statistics of a scenario whose sigmas are estimated: NEES beside what theory makes of it.

    Weighed by an estimated covariance errors have heavier tails than chi-square: their own standard error counts.
    """
    theory = float(np.median([e.inflation for e in errors]))
    of = summary(name, errors)
    sigmas = np.array([e.robots for e in errors if e.robots is not None]).reshape(-1, 2)
    told = {} if not len(sigmas) else {"robots": sigmas.mean(0).tolist(), "robots_scatter": sigmas.std(0).tolist()}
    return (
        of
        | told
        | {
            "theory": theory,
            "found": len(sigmas),
            "inside": bool(abs(of["mean"] - theory) <= ERRORS * of["standard_error"]),
        }
    )


def run(names: Iterable[str], cells: int, first_seed: int, pool: Executor) -> Iterator[dict[str, Any]]:
    """Summaries, scenario by scenario, with the seconds that each took."""
    for name in names:
        began = time.perf_counter()
        scenario = SCENARIOS.get(name) or ESTIMATED[name]
        count = cells if scenario.state_robot_noise else min(cells, CELLS_OF_ROBOTS)
        seeds = range(first_seed, first_seed + count)
        errors = list(pool.map(error_of, [scenario] * count, seeds, chunksize=25))
        told = summary(name, errors) if name in SCENARIOS else estimated_summary(name, errors)
        yield {**told, "seconds": time.perf_counter() - began}


_NUMBERS = ("mean NEES / 6", "standard error", "beyond 99 %", "worst NEES")
_OVER = ("translation / bound", "rotation / bound", "whitened / bound", "well-posed")
HEAD = ("scenario", *_NUMBERS, "unobservable", "not converged", *_OVER, "inside")
ESTIMATED_HEAD = ("scenario", "cells", "mean NEES / 6", "standard error", "theory", "estimated sigmas", "inside")


def row(found: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    numbers = f"{found['mean']:.3f}", f"{found['standard_error']:.3f}", f"{100 * found['beyond_99']:.2f} %"
    counts = f"{found['worst']:.1f}", str(found["unseen"]), str(found["not_converged"])
    over = [f"{found[key]:.3f}" for key in ("shift_over_bound", "turn_over_bound", "over_bound")]
    posed = "yes" if found["well_posed"] else "no"
    return (label(found["scenario"]), *numbers, *counts, *over, posed, "yes" if found["inside"] else "NO")


def estimated_row(found: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `ESTIMATED_HEAD`."""
    numbers = f"{found['mean']:.3f}", f"{found['standard_error']:.3f}", f"{found['theory']:.3f}"
    sigmas = ""
    if "robots" in found:
        (shift, turn), (off, turned) = found["robots"], found["robots_scatter"]
        sigmas = f"{1e3 * shift:.3f} +- {1e3 * off:.3f} mm, {1e3 * turn:.3f} +- {1e3 * turned:.3f} mrad"
    return (label(found["scenario"]), str(found["cells"]), *numbers, sigmas, "yes" if found["inside"] else "NO")


def main(arguments: list[str]) -> None:
    """Run, print; of all scenarios write results/consistency.json too, after each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.consistency", description=__doc__)
    parser.add_argument("--cells", type=int, default=2000, help="of each scenario (default 2000)")
    every = [*SCENARIOS, *ESTIMATED]
    parser.add_argument("--scenarios", nargs="*", default=every, choices=every, metavar="NAME")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args(arguments)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    found: list[dict[str, Any]] = []
    with ProcessPoolExecutor(asked.workers, mp_context=get_context("spawn")) as pool:
        for each in run(asked.scenarios, asked.cells, asked.first_seed, pool):
            found.append(each)
            print(f"{each['seconds']:5.0f} s  {each['mean']:.3f}  {each['scenario']}", flush=True)
            if asked.scenarios == every:
                told = {"cells": asked.cells, "first_seed": asked.first_seed, "band": band(asked.cells)}
                write("consistency", {**told, **_sorted(found)})
    told = _sorted(found)
    print("\n" + table(HEAD, map(row, told["scenarios"])))
    print("\n" + table(ESTIMATED_HEAD, map(estimated_row, told["estimated"])))


def _sorted(found: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    return {
        "scenarios": [each for each in found if each["scenario"] in SCENARIOS],
        "estimated": [each for each in found if each["scenario"] in ESTIMATED],
    }


if __name__ == "__main__":
    main(sys.argv[1:])
