"""Time and memory of a solution, from 100 to 100,000 samples of 4 points.

The time is CPU time. On one thread it is the wall time of an idle machine.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from basecal.cell.targets.chessboard import chessboard_target
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution, solve_from
from basecal.geometry import SE3
from basecal.reporting.study_text import chart_file
from basecal.simulation import Scenario, simulate
from benchmarks.common import on_one_core, table, write

FIGURES = Path(__file__).parents[1] / "docs" / "figures"
SIZES = tuple(round(10 ** (k / 2)) for k in range(4, 11))
FEWEST_STEADY = 1000
START_OFFSET = 2e-3

_FOUR_POINTS = Scenario(target="chessboard", board=chessboard_target((2, 2), 0.12))
# Robot noise is eliminated view by view where every sample is a new stop, and by the Schur complement where stops are
# shared: their number grows with the samples as well (a still eye has one, the hand one a sample).
CASES: dict[str, Scenario] = {
    "no robot noise": _FOUR_POINTS,
    "robot noise": replace(_FOUR_POINTS, robot_noise=(3e-4, 5e-4)),
    "robot noise, five stations": replace(_FOUR_POINTS, robot_noise=(3e-4, 5e-4), arms="stations"),
}


def make_task(scenario: Scenario, samples: int, seed: int) -> tuple[Problem, State]:
    """The packed arrays, and a start that is off by 2 mm and 2 mrad per axis."""
    simulated = simulate(replace(scenario, samples=samples), seed)
    problem, _ = build_problem(simulated.cell, simulated.recording)
    rng = np.random.default_rng(seed)
    start = {name: simulated.truth[name] @ SE3.exp(START_OFFSET * rng.standard_normal(6)) for name in problem.unknowns}
    return problem, State(start, simulated.cameras, np.zeros((len(problem.stops), 6)))


def _peak_bytes(problem: Problem, start: State) -> tuple[int, Solution]:
    """Peak memory of the solution beyond what the problem held before."""
    gc.collect()
    tracemalloc.start()
    held, _ = tracemalloc.get_traced_memory()
    solution = solve_from(problem, start)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak - held, solution


def _processor_seconds(problem: Problem, start: State) -> float:
    began = time.process_time()
    solve_from(problem, start)
    return time.process_time() - began


def measure(case: str, samples: int, seed: int) -> dict[str, Any]:
    """Median time of several solutions, and the peak memory of one."""
    problem, start = make_task(CASES[case], samples, seed)
    peak, solution = _peak_bytes(problem, start)
    assert solution.converged, f"{case}, {samples} samples: no optimum"
    repeats = 3 if samples > 10_000 else 9
    times = [_processor_seconds(problem, start) for _ in range(repeats)]
    return {"case": case, "samples": samples, "seconds": median(times), "peak_bytes": peak}


def slope(rows: list[dict[str, Any]], field: str) -> float:
    """Slope of log(field) over log(samples), by least squares."""
    samples, values = ([row[name] for row in rows] for name in ("samples", field))
    return float(np.polyfit(np.log(samples), np.log(values), 1)[0])


def slopes(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Slopes by case, over all sizes and over sizes at which the time of calls is negligible."""
    out = []
    for case in dict.fromkeys(row["case"] for row in rows):
        of_case = [row for row in rows if row["case"] == case]
        steady = [row for row in of_case if row["samples"] >= FEWEST_STEADY]
        every = {f"{field}_slope": slope(of_case, field) for field in ("seconds", "peak_bytes")}
        late = {f"{field}_slope_from_{FEWEST_STEADY}": slope(steady, field) for field in ("seconds", "peak_bytes")}
        out.append({"case": case, **every, **late})
    return out


def _lines(rows: list[dict[str, Any]], field: str, scale: float) -> dict[str, list[tuple[float, float]]]:
    """A line for each case, and a linear one through the end of the first."""
    cases = dict.fromkeys(row["case"] for row in rows)
    lines = {c: [(r["samples"], scale * r[field]) for r in rows if r["case"] == c] for c in cases}
    first = next(iter(lines.values()))
    (few, _), (many, last_value) = first[0], first[-1]
    return lines | {"linear": [(few, last_value * few / many), (many, last_value)]}


def make_charts(rows: list[dict[str, Any]]) -> dict[str, str]:
    """Charts of time and memory over samples, as SVG by file name."""
    time, memory = _lines(rows, "seconds", 1e3), _lines(rows, "peak_bytes", 1e-6)
    across = "samples of 4 points"
    return {
        "scaling_time.svg": chart_file("Time of a solution", across, "time [ms]", time),
        "scaling_memory.svg": chart_file("Peak memory of a solution", across, "memory [MB]", memory),
    }


HEAD = ("case", "samples", "time [ms]", "us a sample", "peak [MB]", "kB a sample")
SLOPE_HEAD = ("case", "slope of time", f"from {FEWEST_STEADY} on", "slope of memory", f"from {FEWEST_STEADY} on")


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    samples, took, peak = result["samples"], result["seconds"], result["peak_bytes"]
    times = f"{1e3 * took:.1f}", f"{1e6 * took / samples:.1f}"
    return result["case"], f"{samples:,}", *times, f"{peak / 1e6:.2f}", f"{peak / 1e3 / samples:.2f}"


def slope_row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `SLOPE_HEAD`."""
    fields = (
        "seconds_slope",
        f"seconds_slope_from_{FEWEST_STEADY}",
        "peak_bytes_slope",
        f"peak_bytes_slope_from_{FEWEST_STEADY}",
    )
    return result["case"], *(f"{result[field]:.3f}" for field in fields)


def main(arguments: list[str]) -> None:
    """Measure, print; with all sizes and cases write results/scaling.json and docs/figures/scaling_*.svg too."""
    # Only `make bench` installs it, and the page of results does without.
    from threadpoolctl import threadpool_limits

    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description=__doc__)
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="number of samples")
    parser.add_argument("--cases", nargs="*", default=list(CASES), choices=list(CASES), metavar="CASE")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args(arguments)
    on_one_core()
    sizes = [n for n in SIZES if n <= asked.largest]
    with threadpool_limits(1):
        rows = [measure(case, samples, asked.seed) for case in asked.cases for samples in sizes]
    result = {"seed": asked.seed, "rows": rows, "slopes": slopes(rows)}
    print(table(HEAD, map(row, rows)), table(SLOPE_HEAD, map(slope_row, result["slopes"])), sep="\n\n")
    if asked.cases == list(CASES) and tuple(sizes) == SIZES:
        write("scaling", result)
        for name, figure in make_charts(rows).items():
            (FIGURES / name).write_text(figure, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
