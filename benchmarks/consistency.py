"""Whether the covariance tells the truth: errors of the base, squared and weighed by it, over simulated cells.

With xi the error of the base and C its covariance, xi' C^-1 xi is chi-square with 6 degrees of freedom (NEES), so that
NEES / 6 has the mean 1. Over 2,000 cells there are 12,000 degrees of freedom: the mean's standard error is
sqrt(2 / 12,000) = 0.0129, and the band [0.955, 1.046] is 3.5 of them to either side, left by chance once in 2,150
times. Fewer cells have a wider band, by the same chance.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2

from basecal.cell.cell import Status
from basecal.estimation.packing import pack
from basecal.estimation.problem import State
from basecal.estimation.solve import solve_from
from basecal.simulation import Scenario, simulate
from benchmarks.common import table, write

BASE = "eye_base_from_hand_base"
FREEDOMS = 6
CHANCE = 4.65e-4
BEYOND = 0.99
ROBOTS = (3e-4, 5e-4)
ROBOTS_BY_LIGHT = (1e-4, 1e-4)

_BOARD = Scenario(samples=20)
_LIGHT = Scenario(samples=30, target="led")


def _mounts(scenario: Scenario, status: Status) -> Scenario:
    return replace(scenario, camera_mount=status, target_mount=status)


# An arm that stands still leaves the mount on its flange and the base one transform: that mount must be known, exactly
# or by a prior. A light seen from a still hand is one place in space, three numbers for a base's six: left out.
# Twenty samples for a board; thirty for a light, whose every sample gives two equations.
PIXEL_NOISE: dict[str, Scenario] = {
    # The paper's problem, and the design's three statuses, with both arms moving.
    "board, mounts fixed": _mounts(_BOARD, "fixed"),
    "board, mounts free": _BOARD,
    "board, mounts by priors": _mounts(_BOARD, "prior"),
    # Each arm still for half of the samples: everything is seen, from fewer directions.
    "board, mounts free, halves": replace(_BOARD, arms="halves"),
    # One arm still throughout, the other mount known or free; with priors, the still mount's sigma governs the base's.
    "board, eye still, mounts fixed": _mounts(replace(_BOARD, arms="eye_still"), "fixed"),
    "board, eye still, target free": replace(_BOARD, arms="eye_still", camera_mount="fixed"),
    "board, eye still, mounts by priors": _mounts(replace(_BOARD, arms="eye_still"), "prior"),
    "board, hand still, mounts fixed": _mounts(replace(_BOARD, arms="hand_still"), "fixed"),
    "board, hand still, camera free": replace(_BOARD, arms="hand_still", target_mount="fixed"),
    # The same with a light, whose mount is three numbers.
    "light, mounts fixed": _mounts(_LIGHT, "fixed"),
    "light, offset free": replace(_LIGHT, camera_mount="fixed"),
    "light, mounts free": _LIGHT,
    "light, mounts by priors": _mounts(_LIGHT, "prior"),
    "light, eye still, mounts fixed": _mounts(replace(_LIGHT, arms="eye_still"), "fixed"),
    "light, eye still, offset free": replace(_LIGHT, arms="eye_still", camera_mount="fixed"),
}


def _with_robot_noise(scenario: Scenario) -> Scenario:
    return replace(scenario, robot_noise=ROBOTS_BY_LIGHT if scenario.target == "led" else ROBOTS)


SCENARIOS = PIXEL_NOISE | {f"{name}, robot noise": _with_robot_noise(s) for name, s in PIXEL_NOISE.items()}


class Error(NamedTuple):
    """One cell: NEES of its base, whether the descent ended at an optimum, and seconds of the solution."""

    nees: float
    converged: bool
    seconds: float


def error_of(scenario: Scenario, seed: int) -> Error:
    """Solve one cell from the truth; `benchmarks.starts` shows that other starts end there as well."""
    made = simulate(scenario, seed)
    problem, _ = pack(made.cell, made.recording)
    truth = State(made.truth, made.cameras if problem.lenses else {}, np.zeros((len(problem.stops), 6)))
    began = time.perf_counter()
    found = solve_from(problem, truth)
    took = time.perf_counter() - began
    estimate = found.transforms[BASE]
    xi = (estimate.mean.inverse() @ made.truth[BASE]).log()
    seen = BASE not in found.seen.blind
    nees = float(xi @ np.linalg.solve(estimate.covariance, xi)) if seen else float("nan")
    return Error(nees, found.converged, took)


def band(cells: int, chance: float = CHANCE) -> tuple[float, float]:
    """Where the mean of NEES / 6 over `cells` lies, but for a `chance`."""
    freedoms = FREEDOMS * cells
    low, high = chi2.ppf([chance / 2, 1 - chance / 2], freedoms) / freedoms
    return float(low), float(high)


def summary(name: str, errors: list[Error]) -> dict[str, Any]:
    """Statistics of a scenario; cells whose base is not seen are counted, and in no mean."""
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
    }


def run(names: Iterable[str], cells: int, first_seed: int, pool: Executor) -> Iterator[dict[str, Any]]:
    """Summaries, scenario by scenario, with the seconds that each took."""
    seeds = range(first_seed, first_seed + cells)
    for name in names:
        began = time.perf_counter()
        errors = list(pool.map(error_of, [SCENARIOS[name]] * cells, seeds, chunksize=25))
        yield {**summary(name, errors), "seconds": time.perf_counter() - began}


_NUMBERS = ("mean NEES / 6", "standard error", "beyond 99 %", "worst NEES")
HEAD = ("scenario", *_NUMBERS, "not seen", "no optimum", "seconds", "inside")


def row(found: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    numbers = f"{found['mean']:.3f}", f"{found['standard_error']:.3f}", f"{100 * found['beyond_99']:.2f} %"
    counts = f"{found['worst']:.1f}", str(found["unseen"]), str(found["not_converged"]), f"{found['seconds']:.0f}"
    return (found["scenario"], *numbers, *counts, "yes" if found["inside"] else "NO")


def main(arguments: list[str]) -> None:
    """Run, print; of all scenarios write results/consistency.json too, after each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.consistency", description=__doc__)
    parser.add_argument("--cells", type=int, default=2000, help="of each scenario (default 2000)")
    parser.add_argument("--scenarios", nargs="*", default=list(SCENARIOS), choices=list(SCENARIOS), metavar="NAME")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args(arguments)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    found: list[dict[str, Any]] = []
    with ProcessPoolExecutor(asked.workers, mp_context=get_context("spawn")) as pool:
        for each in run(asked.scenarios, asked.cells, asked.first_seed, pool):
            found.append(each)
            print(f"{each['seconds']:5.0f} s  {each['mean']:.3f}  {each['scenario']}", flush=True)
            if asked.scenarios == list(SCENARIOS):
                told = {"cells": asked.cells, "first_seed": asked.first_seed, "band": band(asked.cells)}
                write("consistency", {**told, "scenarios": found})
    print("\n" + table(HEAD, map(row, found)))


if __name__ == "__main__":
    main(sys.argv[1:])
