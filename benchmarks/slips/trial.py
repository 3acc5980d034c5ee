"""One slip played, and all of them summed up."""

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
from benchmarks.slips.desk import CELL, Desk, laid_out
from benchmarks.slips.table import SLIPS, Slip

DRAWS, HOLD, NAMED = 3, 0.99, 0.95
BY_NUMBER = {slip.number: slip for slip in SLIPS}


def played(slip: Slip, draw: int) -> dict[str, Any]:
    """What was said, whether that names cause and cure, and whether a wrong answer passed for good."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        desk = laid_out(Path(folder), draw)
        slip.spoil(desk)
        os.chdir(folder)
        try:
            said, verdict, square = _typed(desk)
            fixed = _fixed(desk, slip) if slip.fix else {}
        finally:
            os.chdir(here)
    is_right = bool(verdict == "good" and square < chi2.ppf(HOLD, 6))
    named = {part: _is_said(pattern, said) for part, pattern in (("cause", slip.cause), ("cure", slip.cure))}
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
        "said": said,
        **fixed,
    }


def _typed(desk: Desk) -> tuple[str, str, float]:
    """All that is printed until a command fails, the verdict, and the largest squared error in sigmas."""
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
    place = desk.folder / CELL
    run = latest_run(place) if place.is_dir() else None
    if run is None:
        return "none", 0.0
    found = read_calibration(run)
    known = [name for name in desk.truth if name in found.transforms]
    squares = [squared_error(place, name, desk.truth[name]) for name in known]
    return found.verdict, max(squares, default=float("inf"))


def _fixed(desk: Desk, slip: Slip) -> dict[str, Any]:
    """What one command of `basecal fix` makes of it."""
    try:
        said, _ = _run(f"basecal fix {CELL} --yes")
    except BasecalError as error:
        said = str(error)
    verdict, square = _answer(desk)
    is_mended = bool(verdict == "good" and square < chi2.ppf(HOLD, 6))
    return {"mended": is_mended, "fix_verdict": verdict, "fix_square": square, "fix_said": " ".join(said.split())}


def _is_said(pattern: str, said: str) -> bool:
    return re.search(pattern, said, re.IGNORECASE) is not None


def summary(trials: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each slip."""
    rows = []
    for number in dict.fromkeys(each["slip"] for each in trials):
        of = [each for each in trials if each["slip"] == number]
        mended = [each["mended"] for each in of if "mended" in each]
        counts = {key: sum(each[key] for each in of) for key in ("named", "silent")}
        rows.append({"slip": number, "draws": len(of), **counts, "mended": sum(mended) if mended else None})
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
    """Play, print, and write results/slips.json if all are played."""
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
            found = kept.of(f"{number} {draw}", lambda n=number, d=draw: played(BY_NUMBER[n], d))
            trials.append(found)
            if asked.show or not found["named"] or not found.get("mended", True):
                print(*(f"{key}: {value}" for key, value in found.items()), "", sep="\n", flush=True)
    result = {"asked": NAMED, "rows": summary(trials)}
    print(section(result))
    if len(asked.only) == len(SLIPS) and asked.draws >= DRAWS:
        write("slips", {**result, "trials": trials})
