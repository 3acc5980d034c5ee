"""First-time users with the files that they have: each types at most five commands, and each draw has new data.

Command: python -m benchmarks.journeys [--draws 100] [--only NAME ...] [--keep FILE].
"""

from __future__ import annotations

import argparse
import io
import os
import shlex
import sys
import tempfile
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2
from tests.journeys.personas import (
    Persona,
    hobby_arms,
    opencv_arm,
    opencv_cameras,
    production,
    ros_sessions,
    three_makers,
)
from tests.journeys.raw import squared_error

from basecal.cell.files import latest_run, read_calibration
from basecal.cli import main as basecal
from benchmarks.common import Kept, on_one_core, table, write

DRAWS, HOLD = 100, 0.99
PERSONAS: dict[str, tuple[Callable[[Path, int], Persona], str]] = {
    "ros": (ros_sessions, "two arms, sessions of easy_handeye2, one arm still in each"),
    "makers": (three_makers, "a UR, a KUKA and an ABB, images and pendant tables"),
    "hobby": (hobby_arms, "two LeRobot arms with joint offsets, a webcam"),
    "production": (production, "a KUKA and an ABB, a tolerance of 3 mm, a report"),
    "opencv": (opencv_arm, "OpenCV's arrays of one arm"),
    "cameras": (opencv_cameras, "OpenCV's arrays of two cameras on one arm"),
}


def trial(name: str, seed: int) -> dict[str, Any]:
    """Exit codes, the verdict, codes of findings, and squared errors in sigmas of one user."""
    previous_folder = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        persona = PERSONAS[name][0](Path(folder), seed)
        os.chdir(folder)
        try:
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                exits = [basecal(shlex.split(command)[1:]) for command in persona.commands]
            return {"persona": name, "exits": exits, **_outcome(Path(folder) / persona.cell, persona)}
        finally:
            os.chdir(previous_folder)


def _outcome(cell_folder: Path, persona: Persona) -> dict[str, Any]:
    run = latest_run(cell_folder) if cell_folder.is_dir() else None
    if run is None:
        return {"verdict": "none", "codes": [], "squares": []}
    calibration = read_calibration(run)
    codes = [each.code for each in calibration.findings if each.severity != "info"]
    truths = {transform: truth for transform, truth in persona.truth.items() if transform in calibration.transforms}
    squares = [squared_error(cell_folder, transform, truth) for transform, truth in truths.items()]
    return {"verdict": calibration.verdict, "codes": codes, "squares": squares}


def summary(name: str, trials: list[dict[str, Any]]) -> dict[str, Any]:
    """A row of the table."""
    squares = np.array([square for each in trials for square in each["squares"]])
    return {
        "persona": name,
        "draws": len(trials),
        "commands": max(len(each["exits"]) for each in trials),
        "failed": sum(any(each["exits"]) for each in trials),
        "not_good": sum(each["verdict"] != "good" for each in trials),
        "codes": sorted({code for each in trials for code in each["codes"]}),
        "held": float(np.mean(squares < chi2.ppf(HOLD, 6))) if len(squares) else 0.0,
        "mean_square": float(squares.mean() / 6) if len(squares) else float("nan"),
    }


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows = [
        (
            PERSONAS[row["persona"]][1],
            row["commands"],
            row["draws"],
            row["failed"],
            row["not_good"],
            ", ".join(row["codes"]),
            f"{row['held']:.1%}",
            f"{row['mean_square']:.2f}",
        )
        for row in result["rows"]
    ]
    about = """\
First-time users have files as other programs write them, with new data in every draw. They type the commands of their
page of the documentation and nothing else. `held` is the share of answers within their 99 % ellipsoid."""
    head = ("user", "commands", "draws", "a command failed", "not good", "findings", "held", "mean square / 6")
    return f"{about}\n\n{table(head, rows)}"


def main(arguments: list[str]) -> None:
    """Run, print, and write results/journeys.json; with `--keep`, of the draws there are."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.journeys", description=__doc__)
    parser.add_argument("--draws", type=int, default=DRAWS)
    parser.add_argument("--only", nargs="+", choices=PERSONAS, default=list(PERSONAS))
    parser.add_argument("--keep", type=Path, help="file in which draws are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept = Kept(asked.keep)
    rows = []
    for name in PERSONAS:
        seeds = [k for k in range(asked.draws) if name in asked.only or f"{name} {k}" in kept]
        trials = [kept.of(f"{name} {k}", lambda name=name, k=k: trial(name, k)) for k in seeds]
        rows += [summary(name, trials)] if trials else []
    print(*rows, sep="\n")
    if asked.keep is not None or (asked.draws >= DRAWS and len(rows) == len(PERSONAS)):
        write("journeys", {"rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
