"""Verbs that write, each with what it starts from and what has to be there when it is run to its end."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from shutil import copytree
from typing import NamedTuple

import basecal.cli.demo as demo
from basecal.cell.files import latest_run, read_calibration, read_cell, read_recording, read_verifications
from torment.cells import made
from torment.outcome import TrialFailed, run_command
from torment.starts import PHOTOS, POSES, replayed, start_cell, unrecorded, with_bag, with_dataset, with_study

_SIMULATED = 3
_PLACES, _FRAMES = 2, 3  # of a bag, and of an episode
_DEMO_PLACES = 6


class Verb(NamedTuple):
    """A verb to cut off.

    Attributes:
        kind: Of the cell that it starts from, see `cells.KINDS`; `images` for one whose camera took images.
        words: Of its command line, of the folder that holds `cell`, and where `new` is made.
        right: Raises an error, or ends with False, where it did not do what it says.
        prepare: Puts what else it starts from into the folder.
        completes: Files that it writes anew, each whole: those before, or those after.
    """

    kind: str
    words: Callable[[Path], list[str]]
    right: Callable[[Path], bool]
    prepare: Callable[[Path], object] = lambda folder: None
    completes: tuple[str, ...] = ()


def _streams(folder: Path, *names: str) -> list[str]:
    return [word for name in names for word in (f"--{name}", str(folder / "poses.txt"))]


def _calibrated(folder: Path) -> bool:
    run = latest_run(folder / "cell")
    return run is not None and bool(read_calibration(run).transforms)


def _samples(folder: Path) -> int:
    return len(read_recording(folder / "new").samples)


def _shorten_demo(folder: Path) -> None:
    """Let a demo go to few places: each of its kills is two demos."""
    demo._SAMPLES["poses"] = _DEMO_PLACES


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
    "demo": Verb(
        "pose",
        lambda folder: ["demo", str(folder / "new")],
        lambda folder: _samples(folder) == _DEMO_PLACES and latest_run(folder / "new") is not None,
        _shorten_demo,
    ),
    "import poses": Verb(
        "pose",
        lambda folder: [
            *("import", "poses", str(folder / "new"), "--length-unit", "m"),
            *_streams(folder, "eye-base-from-flange", "camera-from-target"),
        ],
        lambda folder: _samples(folder) == POSES,
    ),
    "import pixels": Verb(
        "charuco",
        lambda folder: [
            *("import", "pixels", str(folder / "unrecorded"), str(folder / "pixels.csv"), "--length-unit", "m"),
            *_streams(folder, "eye-base-from-flange", "hand-base-from-flange"),
        ],
        lambda folder: len(read_recording(folder / "unrecorded").samples) == POSES,
        unrecorded,
    ),
    "import images": Verb(
        "charuco",
        lambda folder: [*("import", "images", str(folder / "unrecorded"), str(folder / "photos"), "--camera", "wrist")],
        lambda folder: len(read_recording(folder / "unrecorded").samples) == 1,
        unrecorded,
    ),
    "import bag": Verb(
        "pose",
        lambda folder: [
            *("import", "bag", str(folder / "new"), str(folder / "bag"), "--robot", "arm=/arm/pose"),
            *("--view", "cam,tag=/tag/pose", "--on", "cam=world", "tag=arm"),
        ],
        lambda folder: _samples(folder) == _PLACES,
        with_bag,
    ),
    "import lerobot": Verb(
        "joints",
        lambda folder: [
            *("import", "lerobot", str(folder / "unrecorded"), str(folder / "dataset"), "--robot", "eye"),
            *("--unit", "deg", "--every-s", "0"),
        ],
        lambda folder: len(read_recording(folder / "unrecorded").samples) == _FRAMES,
        with_dataset,
    ),
    "merge": Verb(
        "joints",
        lambda folder: ["merge", str(folder / "cell"), str(folder / "twin"), "-o", str(folder / "new")],
        lambda folder: _samples(folder) == 2 * len(made("joints").samples),
        lambda folder: copytree(folder / "cell", folder / "twin"),
    ),
    "fix": Verb(
        "inverted",
        lambda folder: ["fix", str(folder / "cell"), "--yes"],
        lambda folder: read_calibration(latest_run(folder / "cell") or folder).verdict == "good",
        completes=("cell/cell.yaml", "cell/recording/samples.jsonl"),
    ),
    "plan": Verb(
        "pose",
        lambda folder: [
            *("plan", str(folder / "cell"), "--samples", "1", "--task-point", "0.5", "0", "0.3"),
            *("-o", str(folder / "plan.jsonl")),
        ],
        lambda folder: (folder / "plan.jsonl").read_text().count("\n") == 1,
    ),
    "verify": Verb(
        "pose",
        lambda folder: ["verify", str(folder / "cell"), str(folder / "cell" / "recording" / "samples.jsonl")],
        lambda folder: len(read_verifications(folder / "cell")) > 0,
    ),
    "capture": Verb(
        "images",
        lambda folder: [
            *("capture", str(folder / "cell"), "--plan", str(folder / "plan.jsonl"), "--go", "--accept-no-watchdog")
        ],
        lambda folder: len(read_recording(folder / "cell").samples) == PHOTOS,
        replayed,
    ),
    "study": Verb(
        "pose",
        lambda folder: ["study", str(folder / "a.yaml"), "-o", str(folder / "out"), "--workers", "1"],
        lambda folder: (folder / "out" / "report.html").read_text().rstrip().endswith("</html>"),
        with_study,
    ),
    "study of cells": Verb(
        "pose",
        lambda folder: [*("study", "--cells", str(folder / "cell"), "-o", str(folder / "out"), "--workers", "1")],
        lambda folder: (folder / "out" / "report.html").read_text().rstrip().endswith("</html>"),
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
    copytree(start_cell(VERBS[name].kind), folder / "cell")
    (folder / "poses.txt").write_text("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" * POSES)
    VERBS[name].prepare(folder)
    return VERBS[name].words(folder)


def files(folder: Path) -> dict[str, bytes]:
    """What every file below a folder holds."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def check_after(name: str, folder: Path, words: list[str], before: dict[str, bytes]) -> None:
    """After a verb was cut off: what was there is as it was, and the same command again does what it says.

    Raises:
        TrialFailed: if not, or if a sample that was recorded is lost.
    """
    after, completes = files(folder), VERBS[name].completes
    changed = [
        path
        for path, content in before.items()
        if path not in completes and after.get(path) != content and not _is_continued(path, content, after)
    ]
    if [path for path in changed if not path.endswith(("report.html", "report.txt"))]:
        raise TrialFailed(f"{name}: changed {changed}")
    _, code, said = run_command(words)
    try:
        right = VERBS[name].right(folder)
    except (OSError, ValueError) as error:
        raise TrialFailed(f"{name} again, which ended with {code}: {error}") from error
    if not right:
        raise TrialFailed(f"{name} again: not what it says, and it ended with {code}: {said[-200:]!r}")
    final = files(folder)
    halves = [path for path in completes if after[path] not in (before[path], final[path])]
    lost = [path for path, content in after.items() if path not in completes and _is_lost(path, content, final)]
    if halves or lost:
        raise TrialFailed(f"{name}: half of {halves} is there, and samples of {lost} are lost")


def _is_continued(path: str, content: bytes, after: dict[str, bytes]) -> bool:
    """Whether lines were added to the verifications of a cell, which keeps what was there."""
    return path.endswith("verifications.jsonl") and after.get(path, b"").startswith(content)


def _is_lost(path: str, content: bytes, final: dict[str, bytes]) -> bool:
    """Whether whole lines of a journal that was begun are there no more."""
    whole = content[: content.rfind(b"\n") + 1]
    return path.endswith("samples.jsonl") and ".part" not in path and not final.get(path, b"").startswith(whole)
