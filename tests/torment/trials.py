"""One trial of each kind by its seed: what is damaged, and what must hold."""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Callable
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.stats import chi2

from basecal.cell import Cell
from basecal.cell.files import (
    calibration_from_dict,
    latest_run,
    read_calibration,
    read_cell,
    read_recording,
    read_truth,
)
from basecal.errors import InputError
from basecal.exchange.pixels import read_pixels
from basecal.exchange.poses import read_poses
from basecal.kinematics import read_chain
from basecal.reporting.page import page
from basecal.reporting.text import text_report
from cell_example import CELL, LINES, URDF, journal
from torment.cells import KINDS, calibration, made, write
from torment.damage import HOSTILE_TEXTS, ODD_NUMBERS, damaged, places, torn, torn_bytes
from torment.outcome import Fell, of_command, of_reader
from torment.writes import write_fault

Trial = Callable[[Random, Path], str]
_FAR = float(chi2.ppf(0.999, 6))  # squared sigmas of a base beyond its 99.9 % ellipsoid


def read_damaged_cell(chance: Random, folder: Path) -> str:
    """`cell.yaml`, its fields or its bytes damaged."""
    whole = chance.random() < 0.5
    if whole:
        write(folder, damaged(made(chance.choice(list(KINDS))).cell, chance), [], {})
    else:
        (folder / "cell.yaml").write_bytes(torn_bytes(CELL.encode(), chance))
    (folder / "hand.urdf").write_text(URDF)
    return of_reader(lambda: read_cell(folder))


@cache
def _example() -> Cell:
    with TemporaryDirectory() as name:
        (Path(name) / "cell.yaml").write_text(CELL)
        (Path(name) / "hand.urdf").write_text(URDF)
        return read_cell(name)


def read_damaged_recording(chance: Random, folder: Path) -> str:
    """`samples.jsonl`, its fields or its bytes damaged."""
    (folder / "recording").mkdir(exist_ok=True)
    lines = [damaged(line, chance) if chance.random() < 0.6 else line for line in LINES]
    content = journal(*lines)
    content = torn_bytes(content, chance) if chance.random() < 0.4 else content
    (folder / "recording" / "samples.jsonl").write_bytes(content)
    return of_reader(lambda: read_recording(folder, _example()))


def read_damaged_calibration(chance: Random, folder: Path) -> str:
    """`calibration.json`; what is read is reported as text."""
    kind = chance.choice(list(KINDS))
    run = latest_run(made(kind).folder)
    content = (run / "calibration.json").read_text()
    path = folder / "calibration.json"
    if chance.random() < 0.7:
        path.write_text(json.dumps(damaged(json.loads(content), chance)))
    else:
        path.write_bytes(torn_bytes(content.encode(), chance))
    return of_reader(lambda: text_report(read_cell(made(kind).folder), read_calibration(path)))


def read_damaged_truth(chance: Random, folder: Path) -> str:
    """`truth.yaml`."""
    content = (made("pose").folder / "truth.yaml").read_bytes()
    (folder / "truth.yaml").write_bytes(torn_bytes(content, chance))
    return of_reader(lambda: read_truth(folder))


def read_damaged_urdf(chance: Random, folder: Path) -> str:
    """A URDF, its attributes or its bytes damaged."""
    text = made("joints").urdfs["hand.urdf"]
    values = list(re.finditer(r'"([^"]*)"', text))
    for _ in range(chance.randint(1, 3)):
        value = chance.choice(values)
        other = chance.choice([torn(value[1], chance), str(chance.choice(ODD_NUMBERS))])
        text = text[: value.start(1)] + other + text[value.end(1) :] if value.end(1) <= len(text) else text
    content = text.encode("utf-8", "surrogatepass")
    (folder / "a.urdf").write_bytes(torn_bytes(content, chance) if chance.random() < 0.3 else content)
    return of_reader(lambda: read_chain(folder / "a.urdf", "base_link", "tool0"))


def read_damaged_poses(chance: Random, folder: Path) -> str:
    """Poses as text, CSV and archives."""
    matrices = np.tile(np.eye(4), (4, 1, 1))
    far = [0.1, 1.0, *map(float, ODD_NUMBERS[-9:])]
    matrices[:, :3, 3] = [[chance.choice(far) for _ in "xyz"] for _ in range(4)]
    kind, out = chance.choice(["txt", "csv", "npz", "npy"]), io.BytesIO()
    if kind == "txt":
        np.savetxt(out, matrices.reshape(-1, 4))
    elif kind == "csv":
        out.write(b"x,y,z,qx,qy,qz,qw\n")
        np.savetxt(out, np.tile([0.1, 0.2, 0.3, 0, 0, 0, 1], (4, 1)), delimiter=",")
    elif kind == "npz":
        (np.savez if chance.random() < 0.5 else np.savez_compressed)(out, poses=matrices)
    else:
        np.save(out, matrices)
    path = folder / f"poses.{kind}"
    path.write_bytes(torn_bytes(out.getvalue(), chance) if chance.random() < 0.9 else out.getvalue())
    return of_reader(lambda: read_poses(path, chance.choice(["m", "mm"])))


def read_damaged_pixels(chance: Random, folder: Path) -> str:
    """Points as CSV and archives."""
    rows, out = np.array([[0, 1, 10.5, 20.5], [0, 2, 11, 21], [1, 1, 1e3, 2e3]]), io.BytesIO()
    if chance.random() < 0.5:
        path = folder / "pixels.csv"
        out.write(b"sample,id,u,v\n")
        np.savetxt(out, rows, delimiter=",", fmt="%g")
    else:
        path = folder / "pixels.npz"
        np.savez(out, sample=rows[:, 0].astype(int), id=rows[:, 1].astype(int), pixels=rows[:, 2:])
    path.write_bytes(torn_bytes(out.getvalue(), chance, faults=1))
    return of_reader(lambda: read_pixels(path))


def calibrate_damaged(chance: Random, folder: Path) -> str:
    """A cell and its recording, damaged, through `calibrate`: `good` only where the base is where it was."""
    kind = chance.choice(list(KINDS))
    cell, samples, urdfs, _ = made(kind)
    cell = damaged(cell, chance, faults=2) if chance.random() < 0.5 else cell
    if chance.random() < 0.7:
        samples = damaged(samples, chance)
    write(folder, cell, samples if isinstance(samples, list) else [samples], urdfs)
    what, code, out = of_command(["calibrate", str(folder), "--json"])
    return _moved(kind, json.loads(out)) if code == 0 else what


def _moved(kind: str, answer: dict[str, Any]) -> str:
    """`good and moved` where a good answer's base is beyond its ellipsoid from that of the undamaged recording."""
    for name, before in calibration(kind).transforms.items():
        if "_base_from_" not in name or name not in answer["transforms"]:
            continue
        now = calibration_from_dict(answer)[name]
        off = (now.mean.inverse() @ before.mean).log()
        if off @ np.linalg.pinv(now.covariance + before.covariance) @ off > _FAR:
            return "good and moved"
    return "answered"


_VERBS = ("calibrate", "report", "new", "simulate", "export", "detect", "target", "import poses", "import pixels", "")
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
    words = chance.choice([*_VERBS, chance.choice(HOSTILE_TEXTS)]).split()
    words += [here] if chance.random() < 0.9 else []
    for _ in range(chance.randint(0, 4)):
        words += [chance.choice(_OPTIONS), *(chance.choice(values) for _ in range(chance.choice((0, 1, 1, 1, 3))))]
    if any(word.startswith(_ELSEWHERE) for word in words):
        return "refused"
    with contextlib.chdir(folder):
        return of_command(words)[0]


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
    texts = [place for place in places(data) if place and isinstance(_at(data, place), str)]
    for place in chance.sample(texts, min(3, len(texts))):
        _at(data, place[:-1])[place[-1]] = hostile
    try:
        shown = page(cell, read_recording(made(kind).folder, cell), calibration_from_dict(data), title=hostile)
    except InputError:
        return "refused"
    added = set(_active(shown)) - set(before)
    if added:
        raise Fell(f"the page has {sorted(added)} by {hostile!r}")
    return "answered"


def _at(data: Any, place: tuple[Any, ...]) -> Any:
    for key in place:
        data = data[key]
    return data


READERS: dict[str, Trial] = {
    "cell.yaml": read_damaged_cell,
    "samples.jsonl": read_damaged_recording,
    "calibration.json": read_damaged_calibration,
    "truth.yaml": read_damaged_truth,
    "URDF": read_damaged_urdf,
    "poses": read_damaged_poses,
    "pixels": read_damaged_pixels,
}
WHOLE: dict[str, Trial] = {
    "calibrate": calibrate_damaged,
    "command line": command_line,
    "page": hostile_page,
    "write faults": write_fault,
}
