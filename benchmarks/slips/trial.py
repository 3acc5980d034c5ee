"""Trials of slips, and their summary."""

from __future__ import annotations

import argparse
import io
import os
import re
import shlex
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from scipy.stats import chi2
from tests.journeys.raw import squared_error

from basecal.cell.files import latest_run, read_calibration
from basecal.cli import main as basecal
from basecal.errors import BasecalError
from benchmarks.common import Kept, on_one_core, table, write
from benchmarks.slips.desk import CELL, Desk, prepare_desk
from benchmarks.slips.table import SLIPS, Slip

DRAWS, HOLD, LEAST_NAMED = 3, 0.99, 0.95
BY_NUMBER = {slip.number: slip for slip in SLIPS}


def trial(slip: Slip, draw: int) -> dict[str, Any]:
    """Output of the commands, whether it names cause and cure, and whether a wrong answer is called good."""
    previous_folder = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        desk = prepare_desk(Path(folder), draw)
        slip.spoil(desk)
        os.chdir(folder)
        try:
            text, verdict, square = _run_steps(desk)
            fix_result = _run_fix(desk, slip) if slip.fix else {}
        finally:
            os.chdir(previous_folder)
    is_right = bool(verdict == "good" and square < chi2.ppf(HOLD, 6))
    named = {part: _matches(pattern, text) for part, pattern in (("cause", slip.cause), ("cure", slip.cure))}
    is_named = all(named.values()) if slip.cause else is_right
    is_silent = verdict == "good" and not is_right and not is_named
    return {
        "slip": slip.number,
        "draw": draw,
        **named,
        "named": is_named,
        "silent": is_silent,
        "verdict": verdict,
        "square": square,
        "said": text,
        **fix_result,
    }


def _run_steps(desk: Desk) -> tuple[str, str, float]:
    """Output until a command fails, the verdict, and the largest squared error in sigmas."""
    text, code = "", 0
    for step in [*desk.steps, f"basecal calibrate {CELL}"]:
        if callable(step):
            step(desk.folder)
            continue
        printed, code = _run(step)
        text += printed
        if code > 1:  # refused; a warning of an import stops nobody
            break
    return " ".join(text.split()), *_answer(desk)


def _run(command: str) -> tuple[str, int]:
    printed = io.StringIO()
    with redirect_stdout(printed), redirect_stderr(printed):
        code = basecal(shlex.split(command)[1:])
    return printed.getvalue(), code


def _answer(desk: Desk) -> tuple[str, float]:
    cell_folder = desk.folder / CELL
    run = latest_run(cell_folder) if cell_folder.is_dir() else None
    if run is None:
        return "none", 0.0
    calibration = read_calibration(run)
    names = [name for name in desk.truth if name in calibration.transforms]
    squares = [squared_error(cell_folder, name, desk.truth[name]) for name in names]
    return calibration.verdict, max(squares, default=float("inf"))


def _run_fix(desk: Desk, slip: Slip) -> dict[str, Any]:
    """Result of one `basecal fix`."""
    try:
        text, _ = _run(f"basecal fix {CELL} --yes")
    except BasecalError as error:
        text = str(error)
    verdict, square = _answer(desk)
    is_fixed = bool(verdict == "good" and square < chi2.ppf(HOLD, 6))
    return {"mended": is_fixed, "fix_verdict": verdict, "fix_square": square, "fix_said": " ".join(text.split())}


def _matches(pattern: str, text: str) -> bool:
    return re.search(pattern, text, re.IGNORECASE) is not None


def summary(trials: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each slip."""
    rows = []
    for number in dict.fromkeys(each["slip"] for each in trials):
        trials_of_slip = [each for each in trials if each["slip"] == number]
        mended = [each["mended"] for each in trials_of_slip if "mended" in each]
        counts = {key: sum(each[key] for each in trials_of_slip) for key in ("named", "silent")}
        rows.append({"slip": number, "draws": len(trials_of_slip), **counts, "mended": sum(mended) if mended else None})
    return rows


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows, draws = result["rows"], sum(row["draws"] for row in result["rows"])
    named, silent = (sum(row[key] for row in rows) for key in ("named", "silent"))
    fixable = [row for row in rows if row["mended"] is not None]
    mended, tried = sum(row["mended"] for row in fixable), sum(row["draws"] for row in fixable)
    about = f"""\
Files of a UR, a KUKA and a camera, each with a common slip of users, go through `basecal import` and `basecal
calibrate`. In {named} of {draws} trials ({named / draws:.0%}; required: {result["asked"]:.0%}) cause and cure are
named, or the answer is right. {silent} answers are silently wrong. One `basecal fix` fixes {mended} of the {tried}
trials that it can fix: the answer is then good, and within its 99 % ellipsoid."""
    head = ("slip", "what is wrong", "named", "silently wrong", "fixed by `fix`")
    lines = [
        (
            row["slip"],
            BY_NUMBER[row["slip"]].words,
            f"{row['named']} of {row['draws']}",
            row["silent"],
            "" if row["mended"] is None else f"{row['mended']} of {row['draws']}",
        )
        for row in rows
    ]
    return f"{about}\n\n{table(head, lines)}"


def main(arguments: list[str]) -> None:
    """Run, print, and write results/slips.json if all slips are tried."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.slips")
    parser.add_argument("--draws", type=int, default=DRAWS)
    parser.add_argument("--only", nargs="+", choices=list(BY_NUMBER), default=list(BY_NUMBER))
    parser.add_argument("--show", action="store_true", help="print all that is said")
    parser.add_argument("--keep", type=Path, help="file in which trials are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept, trials = Kept(asked.keep), []
    for number in asked.only:
        for draw in range(asked.draws):
            result_of_trial = kept.of(f"{number} {draw}", lambda n=number, d=draw: trial(BY_NUMBER[n], d))
            trials.append(result_of_trial)
            if asked.show or not result_of_trial["named"] or not result_of_trial.get("mended", True):
                print(*(f"{key}: {value}" for key, value in result_of_trial.items()), "", sep="\n", flush=True)
    result = {"asked": LEAST_NAMED, "rows": summary(trials)}
    print(section(result))
    if len(asked.only) == len(SLIPS) and asked.draws >= DRAWS:
        write("slips", {**result, "trials": trials})
