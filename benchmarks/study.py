"""Calibrations a second through a study, by solver, with draws, starts, processes and files of trials.

At pixel level: 30 samples of a rigid target of 24 points, both mounts and the base free, with the covariance. The
closed form of the paper is for one station. OpenCV's robot-world solver has 30 samples of the same target.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from basecal.studies.jobs import WorkerPool
from basecal.studies.run import run_study
from basecal.studies.study_file import study_from_text
from basecal.studies.summary import results
from benchmarks.common import table, write

BOARD = "samples: 30, board: {kind: chessboard, corners: [6, 4], square_m: 0.04}"
HOLDS = {
    "maximum_likelihood": BOARD,
    "closed_form": "layout: shifts, distance_m: 3.6, pixel_px: 0.1, solver: closed_form",
    "opencv": f"layout: eye_in_hand, solver: opencv, {BOARD}",
}
TRIALS = {"maximum_likelihood": 20_480, "closed_form": 2_000_000, "opencv": 2048}
CELLS = 8
REQUIRED_RATE = {"maximum_likelihood": 2000.0, "closed_form": 300_000.0}
HEAD = ("solver", "trials", "processes", "wall time [s]", "a second", "required", "solved")


def measure(solver: str, trials: int, workers: int) -> dict[str, Any]:
    """Run one study, from nothing to all its chunks on the disk."""
    text = f"schema: basecal/study/1\ntrials: {trials}\ncells: {CELLS}\nhold: {{{HOLDS[solver]}}}\n"
    study = study_from_text(text, "study.yaml")
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        run_study(study, Path(folder) / "out", WorkerPool(workers))
        took = time.perf_counter() - begin
        solved = sum(int(result.trials.solved.sum()) for _, result in results(study, Path(folder) / "out"))
    fields = {"solver": solver, "trials": trials, "workers": workers, "seconds": took, "solved": solved}
    return {**fields, "rate": trials / took}


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table."""
    required = REQUIRED_RATE.get(result["solver"])
    return (
        result["solver"],
        str(result["trials"]),
        str(result["workers"]),
        f"{result['seconds']:.1f}",
        f"{result['rate']:.0f}",
        "" if required is None else f"{required:.0f}",
        f"{result['solved'] / result['trials']:.2%}",
    )


def main() -> None:
    """Run each solver on all cores."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=1.0, help="of the trials")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    rows = [
        measure(solver, max(CELLS, int(options.share * count)), options.workers) for solver, count in TRIALS.items()
    ]
    print(table(HEAD, map(row, rows)))
    write("study", {"rows": rows})


if __name__ == "__main__":
    main()
