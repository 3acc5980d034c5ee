"""Verbs that write, each with what it starts from and what has to be there when it is run to its end."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from shutil import copytree
from typing import NamedTuple

from basecal.cell.files import latest_run, read_calibration, read_cell, read_recording
from torment.cells import made
from torment.outcome import Fell, of_command

_POSES = 5
_PIXELS = 12  # of each sample
_SIMULATED = 3


class Verb(NamedTuple):
    """A verb to cut off.

    Attributes:
        kind: Of the cell that it starts from, see `cells.KINDS`; `images` for one whose camera took pictures.
        words: Of its command line, of the folder that holds `cell`, and where `new` is made.
        right: Raises an error, or ends with False, where it did not do what it says.
    """

    kind: str
    words: Callable[[Path], list[str]]
    right: Callable[[Path], bool]


def _streams(folder: Path, *names: str) -> list[str]:
    return [word for name in names for word in (f"--{name}", str(folder / "poses.txt"))]


def _calibrated(folder: Path) -> bool:
    run = latest_run(folder / "cell")
    return run is not None and bool(read_calibration(run).transforms)


def _samples(folder: Path) -> int:
    return len(read_recording(folder / "new").samples)


VERBS: dict[str, Verb] = {
    "calibrate": Verb("pose", lambda folder: ["calibrate", str(folder / "cell")], _calibrated),
    "report": Verb("led", lambda folder: ["report", str(folder / "cell")], _calibrated),
    "new": Verb(
        "pose",
        lambda folder: ["new", str(folder / "new")],
        lambda folder: bool(read_cell(folder / "new").robots),
    ),
    "simulate": Verb(
        "pose",
        lambda folder: ["simulate", str(folder / "new"), "--samples", str(_SIMULATED), "--joints"],
        lambda folder: _samples(folder) == _SIMULATED,
    ),
    "import poses": Verb(
        "pose",
        lambda folder: [
            *("import", "poses", str(folder / "new"), "--length-unit", "m"),
            *_streams(folder, "eye-base-from-flange", "camera-from-target"),
        ],
        lambda folder: _samples(folder) == _POSES,
    ),
    "import pixels": Verb(
        "charuco",
        lambda folder: [
            *("import", "pixels", str(folder / "unrecorded"), str(folder / "pixels.csv"), "--length-unit", "m"),
            *_streams(folder, "eye-base-from-flange", "hand-base-from-flange"),
        ],
        lambda folder: len(read_recording(folder / "unrecorded").samples) == _POSES,
    ),
    "export": Verb(
        "joints",
        lambda folder: ["export", str(folder / "cell"), "--to", "json", "-o", str(folder / "out.json")],
        lambda folder: (folder / "out.json").read_text().endswith("}\n"),
    ),
    "target": Verb(
        "pose",
        lambda folder: ["target", str(folder / "board.svg")],
        lambda folder: (folder / "board.svg").read_text().rstrip().endswith("</svg>"),
    ),
    "detect": Verb("images", lambda folder: ["detect", str(folder / "cell")], lambda folder: True),
}


def prepared(name: str, folder: Path) -> list[str]:
    """Put what a verb starts from into a folder, and give the words of its command line."""
    copytree(_cell(VERBS[name].kind), folder / "cell")
    (folder / "poses.txt").write_text("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" * _POSES)
    if name == "import pixels":
        copytree(folder / "cell", folder / "unrecorded")
        (folder / "unrecorded" / "recording" / "samples.jsonl").unlink()
        rows = [
            f"{sample},{point},{100 + point},{200 + sample}" for sample in range(_POSES) for point in range(_PIXELS)
        ]
        (folder / "pixels.csv").write_text("\n".join(["sample,id,u,v", *rows, ""]))
    return VERBS[name].words(folder)


@cache
def _cell(kind: str) -> Path:
    if kind != "images":
        return made(kind).folder
    folder = made("charuco").folder.parent / "images"
    of_command(["simulate", str(folder), "--samples", "2", "--images"])
    return folder


def files(folder: Path) -> dict[str, bytes]:
    """What every file below a folder holds."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def check_after(name: str, folder: Path, words: list[str], before: dict[str, bytes]) -> None:
    """After a verb was cut off: what was there is as it was, and the same command again does what it says.

    Raises:
        Fell: if not.
    """
    after = files(folder)
    changed = [path for path, content in before.items() if after.get(path) != content]
    if [path for path in changed if not path.endswith(("report.html", "report.txt"))]:
        raise Fell(f"{name}: changed {changed}")
    _, code, said = of_command(words)
    try:
        right = VERBS[name].right(folder)
    except (OSError, ValueError) as error:
        raise Fell(f"{name} again, which ended with {code}: {error}") from error
    if not right:
        raise Fell(f"{name} again: not what it says, and it ended with {code}: {said[-200:]!r}")
