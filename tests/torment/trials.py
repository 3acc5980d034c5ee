"""One trial of each kind by its seed: what is damaged, and what must hold."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from random import Random
from typing import Any

from basecal.cell.files import (
    calibration_from_dict,
    latest_run,
    read_cell,
    read_recording,
)
from basecal.errors import InputError
from basecal.reporting.page import page
from basecal.studies.solvers.registry import SOLVERS
from basecal.studies.study_file import read_study
from torment import besides, disks, system_calls
from torment.cells import KINDS, calibration, cell_text, made, moved_or_good, write
from torment.damage import HOSTILE_TEXTS, at, damaged, places
from torment.exports import EXPORTS
from torment.foreign import read_damaged_film, read_damaged_tables
from torment.hostile_cell import hostile_cell
from torment.numbers import calibrate_strange
from torment.others import OTHERS
from torment.outcome import TrialFailed, run_command, run_reader
from torment.sessions import SESSIONS
from torment.writes import write_fault

Trial = Callable[[Random, Path], str]


def calibrate_damaged(chance: Random, folder: Path) -> str:
    """A cell and its recording, damaged, through `calibrate`: `good` only where the base is where it was."""
    kind = chance.choice(list(KINDS))
    cell, samples, urdfs, _ = made(kind)
    cell = damaged(cell, chance, faults=2) if chance.random() < 0.5 else cell
    if chance.random() < 0.7:
        samples = damaged(samples, chance)
    write(folder, cell, samples if isinstance(samples, list) else [samples], urdfs)
    what, code, out = run_command(["calibrate", str(folder), "--json"])
    return moved_or_good(kind, json.loads(out)) if code == 0 else what


def verify_damaged(chance: Random, folder: Path) -> str:
    """New samples, damaged, against an undamaged calibration."""
    kind = chance.choice(list(KINDS))
    few = made(kind).samples[: chance.randint(1, 4)]
    samples = damaged(few, chance)
    lines = samples if isinstance(samples, list) else [samples]
    (folder / "new.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return run_command(["verify", str(made(kind).folder), str(folder / "new.jsonl"), "--json"])[0]


def compare_damaged(chance: Random, folder: Path) -> str:
    """A run whose calibration is damaged, beside that which it was."""
    run = latest_run(made(chance.choice(list(KINDS))).folder)
    assert run is not None
    data = damaged(json.loads((run / "calibration.json").read_text()), chance)
    (folder / "calibration.json").write_text(json.dumps(data))
    return run_command(["compare", str(run), str(folder), *chance.choice(([], ["--json"]))])[0]


def plan_damaged(chance: Random, folder: Path) -> str:
    """What to record next in a cell that is damaged."""
    kind = chance.choice(list(KINDS))
    cell, samples = made(kind).cell, made(kind).samples
    if chance.random() < 0.5:
        cell = damaged(cell, chance, faults=2)
    else:
        samples = damaged(samples, chance)
    write(folder, cell, samples if isinstance(samples, list) else [samples], made(kind).urdfs)
    words = ["plan", str(folder), "--samples", "1", "--task-point", "0.5", "0", "0.3"]
    return run_command([*words, *chance.choice(([], ["--json"]))])[0]


_STUDY: dict[str, Any] = {
    "schema": "basecal/study/1",
    "trials": 2,
    "cells": 1,
    "hold": {"samples": 4, "robot_sigma_t_m": 1e-4},
    "axes": {"target": ["chessboard", "led"], "pixel_px": [0.1, 0.2]},
}


def study_damaged(chance: Random, folder: Path) -> str:
    """A small study that is damaged, run where it stays small."""
    data = damaged({**_STUDY, "hold": {**_STUDY["hold"], "solver": chance.choice([*SOLVERS])}}, chance, faults=2)
    (folder / "a.yaml").write_text(cell_text(data))
    if isinstance(data, dict) and any(key in data and data[key] != _STUDY[key] for key in ("trials", "cells")):
        return run_reader(lambda: read_study(folder / "a.yaml"))
    return run_command(["study", str(folder / "a.yaml"), "-o", str(folder / "out"), "--workers", "1"])[0]


_VERBS = (
    "calibrate",
    "report",
    "new",
    "simulate",
    "export",
    "detect",
    "target",
    "import poses",
    "import pixels",
    "",
)
_OPTIONS = [
    "--json",
    "--robots",
    "--target",
    "--samples",
    "--seed",
    "--pixel-px",
    "--mounts",
    "--joints",
    "-o",
    "--to",
    "--robot",
    "--transform",
    "--run",
    "--length-unit",
    "--invert",
    "--camera-from-target",
    "--eye-base-from-flange",
    "--task-point",
    "--method",
    "--start",
    "--kind",
    "--columns",
    "--rows",
    "--square-mm",
    "--marker-mm",
    "--set",
    "--cell",
    "--name",
    "--tag",
    "--sigma-px",
    "--camera",
    "--robot-noise-mm",
    "--joint-offset-deg",
    "--help",
    "--bogus",
]
_VALUES = [
    "3",
    "1",
    "0",
    "-1",
    "nan",
    "inf",
    "1e308",
    "m",
    "mm",
    "pose",
    "led",
    "free",
    "charuco",
    "axis-shift",
    "guess",
    "legacy_pattern=true",
    "square_m=1e9",
]
_ELSEWHERE = ("..", "/dev", "file:")  # what would be written to, since it was asked for


def command_line(chance: Random, folder: Path) -> str:
    """Words of a command line, most of them known."""
    here = str(folder / "c")
    values = [here, str(made("pose").folder / "cell.yaml"), str(folder / "b.svg"), str(folder / "b.pdf"), *_VALUES]
    values += [text for text in HOSTILE_TEXTS if "\0" not in text and "\ud800" not in text]
    words = chance.choice([*_VERBS, "completion", chance.choice(HOSTILE_TEXTS)]).split()
    words += [here] if chance.random() < 0.9 else []
    for _ in range(chance.randint(0, 4)):
        words += [chance.choice(_OPTIONS), *(chance.choice(values) for _ in range(chance.choice((0, 1, 1, 1, 3))))]
    if any(word.startswith(_ELSEWHERE) for word in words):
        return "refused"
    with contextlib.chdir(folder):
        return run_command(words)[0]


class _Active(HTMLParser):
    """Elements and attributes by which a page could do something."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag in ("script", "iframe", "object", "embed", "link", "base", "form", "img", "svg", "meta"):
            self.found.append(tag)
        self.found += [name for name, value in attributes if name.startswith("on") or "javascript:" in (value or "")]


def _active(text: str) -> list[str]:
    parser = _Active()
    parser.feed(text)
    return sorted(set(parser.found))


def hostile_page(chance: Random, folder: Path) -> str:
    """A text of a calibration made hostile: its page has no element and no handler that it had not before."""
    kind = chance.choice(list(KINDS))
    cell = read_cell(made(kind).folder)
    data = json.loads((latest_run(made(kind).folder) / "calibration.json").read_text())
    before = _active(page(cell, read_recording(made(kind).folder, cell), calibration(kind)))
    hostile = chance.choice(HOSTILE_TEXTS)
    texts = [place for place in places(data) if place and isinstance(at(data, place), str)]
    for place in chance.sample(texts, min(3, len(texts))):
        at(data, place[:-1])[place[-1]] = hostile
    try:
        shown = page(cell, read_recording(made(kind).folder, cell), calibration_from_dict(data), title=hostile)
    except InputError:
        return "refused"
    added = set(_active(shown)) - set(before)
    if added:
        raise TrialFailed(f"the page has {sorted(added)} by {hostile!r}")
    return "answered"


WHOLE: dict[str, Trial] = {
    "calibrate": calibrate_damaged,
    "calibrate, numbers": calibrate_strange,
    "command line": command_line,
    "page": hostile_page,
    "write faults": write_fault,
    "kills at system calls": system_calls.kill,
    "faults of system calls": system_calls.fault,
    "hostile cell": hostile_cell,
    "slow disk": disks.slow_disk,
    "read-only": disks.read_only,
    "lerobot": read_damaged_tables,
    "lerobot film": read_damaged_film,
    "import bag": besides.import_damaged_bag,
    "verify": verify_damaged,
    "compare": compare_damaged,
    "plan": plan_damaged,
    "study, run": study_damaged,
    **OTHERS,
    **SESSIONS,
    **EXPORTS,
}
