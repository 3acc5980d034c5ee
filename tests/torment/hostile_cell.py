"""A cell whose every field leads out of it, opened by verbs under a tracer in a network namespace of their own.

`python -m torment.hostile_cell` tries each field with each lure by each verb, and prints what was reached; a trial by
its seed tries one of them. Nothing connects; of files outside only those are opened that the verb opens for a harmless
cell too, and those of Python and its packages. Lures that keep the cell readable are tried several at once: where a
verb answers, it came past all of them, and where it refuses or reaches anything, halves of them are tried.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import re
import shutil
import sys
import sysconfig
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from random import Random
from shutil import copytree
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

import basecal
from basecal.cell.files import latest_run, read_calibration, read_cell, read_recording, read_truth
from basecal.errors import BasecalError
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.vision.image_file import png_bytes
from torment import record
from torment.cells import cell_text, made
from torment.damage import at, places
from torment.outcome import TrialFailed
from torment.record import Row, table
from torment.system_calls import is_possible
from torment.traced import COMMAND, TracedServer

MAIN = COMMAND
_CALL = re.compile(r"^(?:\d+ +)?(\w+)\((.*)$", re.M)
_NAMED = re.compile(r'(?:AT_FDCWD<([^>]*)>|\d+<([^>]*)>)?(?:, )?"((?:[^"\\]|\\.)*)"')
_OPENED = re.compile(r"= \d+<(/[^>]*)>")
_UNNAMED = re.compile(r"/#\d+$")  # what is made without a name, in a folder
_ASKS = {
    "stat",
    "lstat",
    "newfstatat",
    "statx",
    "access",
    "faccessat",
    "faccessat2",
    "readlink",
    "readlinkat",
    "getcwd",
}
_CONNECTS = {"connect", "sendto", "sendmsg", "sendmmsg"}
_INTERNET = re.compile(r"sa_family=AF_INET|sin_addr|sin6_addr")
_SECRET = "outside"
EACH = "hostile cell, each"  # in what is recorded
_TEXTS = 5  # lures of each field, one after another
_AT_ONCE = 8
_RECORDED_AT_ONCE = 200  # a multiple of the texts
_SHOWN = 300  # characters
_URDF_TEXT = re.compile(r'"([^"]*)"')

_IMAGE = png_bytes(np.zeros((720, 1280), dtype=np.uint8))
_LENS = """image_width: 1280
image_height: 720
camera_matrix: {rows: 3, cols: 3, data: [915, 0, 640, 0, 915, 360, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""

VERBS: dict[str, Callable[[str], list[str]]] = {
    "calibrate": lambda cell: ["calibrate", cell],
    "detect": lambda cell: ["detect", cell],
    "report": lambda cell: ["report", cell],
    "plan": lambda cell: ["plan", cell, "--samples", "1", "--task-point", "0.5", "0", "0.3"],
    "verify": lambda cell: ["verify", cell, f"{cell}/../twin/recording/samples.jsonl"],
    "compare": lambda cell: ["compare", cell, cell],
    "merge": lambda cell: ["merge", cell, f"{cell}/../twin", "-o", f"{cell}/../merged"],
    "fix": lambda cell: ["fix", cell, "--yes"],
    "capture": lambda cell: ["capture", cell],
    "driver check": lambda cell: ["driver", "check", cell, "eye"],
    "target": lambda cell: ["target", f"{cell}/board.svg", "--cell", cell, "--name", "board"],
    "demo": lambda cell: ["demo", cell],
    "new": lambda cell: ["new", cell],
    "simulate": lambda cell: ["simulate", cell, "--samples", "2"],
    "study": lambda cell: ["study", "--cells", cell, "-o", f"{cell}/../study", "--workers", "1"],
    "import poses": lambda cell: _imported(cell, "poses", "--robot", "eye", f"{cell}/../poses.txt", "--format", "ur"),
    "import images": lambda cell: _imported(cell, "images", f"{cell}/../photos", "--camera", "wrist"),
    "import camera-info": lambda cell: ["import", "camera-info", cell, f"{cell}/../lens.yaml", "--camera", "wrist"],
    **{f"export {kind}": lambda cell, kind=kind: _exported(cell, kind) for kind in EXPORTERS},
}
"""Words of each verb that opens a cell; `view`, which stays until it is interrupted, and `completion` open no more."""


def _imported(cell: str, kind: str, *words: str) -> list[str]:
    return ["import", kind, cell, *words, "--session"]


def _exported(cell: str, kind: str) -> list[str]:
    return ["export", cell, "--to", kind, *(("--robot", "eye") if kind in ("urdf", "urdf_joint") else ())]


_DRIVERS = (
    {"kind": "opcua", "url": "opc.tcp://127.0.0.1:9", "joints": ["a"], "unit": "rad", "user": "me"},
    {"kind": "ur", "host": "127.0.0.1"},
)


class Lure(NamedTuple):
    """A hostile cell: a file of it, a place in that file (none if the file is a link), and the text that is there."""

    file: str
    place: tuple[Any, ...]
    text: str


def lures(outside: Path, cell: Path) -> Iterator[Lure]:
    """Each field of each file of a cell with each text that leads out of it, and each file as a link."""
    for file, data in _data().items():
        for place in places(data):
            if place and isinstance(at(data, place), str):
                yield from (Lure(file, place, text) for text in _texts(outside, (cell / file).parent))
    urdf = made("joints").urdfs["eye.urdf"]
    for k in range(len(_URDF_TEXT.findall(urdf))):
        yield from (Lure("eye.urdf", (k,), text) for text in _texts(outside, cell))
    for file in (*_data(), "eye.urdf", "truth.yaml", "recording", "runs", "derived"):
        yield Lure(file, (), str(outside.parent))


def _texts(outside: Path, folder: Path) -> tuple[str, ...]:
    near = os.path.relpath(outside, folder)
    return str(outside), near, f"file://{outside}", "http://127.0.0.1:9/x", f"$(cat {outside})"


@cache
def _data() -> Mapping[str, Any]:
    """The files of a cell that are plain data, whose arms and camera name other machines."""
    cell = json.loads(json.dumps(made("joints").cell))
    for robot, driver in zip(cell["robots"].values(), _DRIVERS, strict=True):
        robot["driver"] = driver
    truth = read_truth(made("joints").folder)
    for entry, name in (
        (cell["bases"]["hand"], "eye_base_from_hand_base"),
        (cell["cameras"]["wrist"]["mount"], "eye_flange_from_wrist"),
        (cell["targets"]["board"]["mount"], "hand_flange_from_board"),
    ):
        entry["guess"] = {"t_m": truth[name].translation.tolist(), "q_xyzw": truth[name].quaternion.tolist()}
    cell["cameras"]["wrist"]["driver"] = {"kind": "opencv", "source": "http://127.0.0.1:9/x"}
    samples = [dict(sample) for sample in made("joints").samples]
    samples[0] |= {"images": {"wrist": "recording/images/0.png"}, "observations": []}
    run = latest_run(made("joints").folder)
    assert run is not None
    calibration = json.loads((run / "calibration.json").read_text())
    return {"cell.yaml": cell, "recording/samples.jsonl": samples[:1], f"runs/{run.name}/calibration.json": calibration}


def lay(folder: Path, lures: Sequence[Lure]) -> None:
    """Write `cell`, hostile by lures, beside what verbs take in, and `outside` with files of its names."""
    cell, outside = folder / "cell", folder / _SECRET
    copytree(made("joints").folder, cell)
    copytree(made("joints").folder, outside)
    for file, data in _data().items():
        _write(cell / file, data)
    for name in ("cell/recording/images", "photos"):
        (folder / name).mkdir()
        (folder / name / "0.png").write_bytes(_IMAGE)
    copytree(cell, folder / "twin")
    (folder / "poses.txt").write_text("0.1 0.2 0.3 0 0 0\n" * 12)
    (folder / "lens.yaml").write_text(_LENS)
    for file in {lure.file for lure in lures}:
        _set(cell, outside, file, {lure.place: lure.text for lure in lures if lure.file == file})


def _set(cell: Path, outside: Path, file: str, texts: Mapping[tuple[Any, ...], str]) -> None:
    """Write texts at their places of a file, or a link that leads out where the place is the file itself."""
    path = cell / file
    if () in texts:
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        path.symlink_to(outside / file)
    elif path.suffix == ".urdf":
        numbers = itertools.count()
        urdf = made("joints").urdfs[file]
        path.write_text(_URDF_TEXT.sub(lambda found: f'"{texts.get((next(numbers),), found[1])}"', urdf))
    else:
        data = json.loads(json.dumps(_data()[file]))
        for place, text in texts.items():
            at(data, place[:-1])[place[-1]] = text
        _write(path, data)


def _write(path: Path, data: Any) -> None:
    if path.suffix == ".jsonl":
        lines = [*data, *made("joints").samples[len(data) :]]
        path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    else:
        path.write_text(cell_text(data) if path.suffix == ".yaml" else json.dumps(data))


def reached(verb: str, folder: Path, *lures: Lure) -> tuple[int, set[str]]:
    """Exit code of a verb in a cell, and what it reached outside: its files and hosts."""
    lay(folder, lures)
    code, calls = _server().run(VERBS[verb](str(folder / "cell")), folder / "cell", MAIN)
    return code, set(_outside(calls, folder))


@cache
def _server() -> TracedServer:
    return TracedServer()


def _outside(trace: str, folder: Path) -> Iterator[str]:
    """What calls reached: hosts, and files neither below the folder, but for what is outside there, nor of Python."""
    for call, arguments in _CALL.findall(trace):
        if call in _CONNECTS and _INTERNET.search(arguments):
            yield f"{call} {arguments}"
        if call in _CONNECTS or call in _ASKS:
            continue
        found = [os.path.join(here or other or folder, name) for here, other, name in _NAMED.findall(arguments)]
        for path in [*found, *_OPENED.findall(arguments)]:
            whole = _UNNAMED.sub("", os.path.normpath(path))
            if not f"{whole}/".startswith(_own_folders()) and not _is_inside(whole, folder):
                yield f"{call} {whole}"


def _is_inside(path: str, folder: Path) -> bool:
    return Path(path).is_relative_to(folder) and not Path(path).is_relative_to(folder / _SECRET)


@cache
def _own_folders() -> tuple[str, ...]:
    """Folders of Python, its packages and this one, libraries of the system, and what it makes of a process."""
    own = {sys.prefix, sys.base_prefix, sys.exec_prefix, str(Path(basecal.__file__).parents[1])}
    own |= {*sysconfig.get_paths().values(), *(path for path in sys.path if path)}
    system = ("/proc/", "/sys/", "/dev/null", "/lib/", "/usr/lib/", "/etc/ld.so.cache", "/etc/ssl/openssl.cnf")
    return (*system, *(f"{os.path.realpath(each)}/" for each in own if os.path.isdir(each)))


@cache
def harmless(verb: str) -> frozenset[str]:
    """What a verb reaches outside of a harmless cell; the server imports here what it needs."""
    with TemporaryDirectory(prefix="torment-") as name:
        lay(Path(name), ())
        _server().prepare(VERBS[verb](f"{name}/cell"), Path(name))
    with TemporaryDirectory(prefix="torment-") as name:
        return frozenset(reached(verb, Path(name))[1])


def _try(verb: str, folder: Path, *lures: Lure) -> str:
    """What came of a verb in a cell with lures.

    Raises:
        TrialFailed: if it reached anything, or ended as none may.
    """
    known = harmless(verb)  # first: the server imports what it needs
    code, found = reached(verb, folder, *lures)
    if found := found - known:
        raise TrialFailed(f"{verb}, {lures}: reached {sorted(found)[:5]}")
    if code not in (0, 1, 2, 3, 4, 5):
        raise TrialFailed(f"{verb}, {lures}: exit code {code}")
    return "refused" if code in (2, 3) else "answered"


def _count() -> int:
    nowhere = Path("/nowhere") / _SECRET / "eye.urdf"
    return len(list(lures(nowhere, nowhere)))


def _chosen(folder: Path, numbers: Sequence[int]) -> list[Lure]:
    known = list(lures(folder / _SECRET / "eye.urdf", folder / "cell"))
    return [known[number] for number in numbers]


@cache
def _is_readable(number: int) -> bool:
    """Whether a cell with a lure in a field is read at all."""
    with TemporaryDirectory(prefix="torment-") as name:
        (lure,) = _chosen(Path(name), [number])
        lay(Path(name), [lure])
        cell = Path(name) / "cell"
        try:
            read_recording(cell, read_cell(cell))
            read_calibration(latest_run(cell) or cell)
        except BasecalError:
            return False
        return bool(lure.place)


def _groups(numbers: Sequence[int]) -> Iterator[list[int]]:
    """Lures that are tried at once: alone where the cell is not read, else several of one text, so of many fields."""
    yield from ([number] for number in numbers if not _is_readable(number))
    for text in range(_TEXTS):
        several = [number for number in numbers if _is_readable(number) and number % _TEXTS == text]
        yield from (several[k : k + _AT_ONCE] for k in range(0, len(several), _AT_ONCE))


def _come(verb: str, numbers: Sequence[int]) -> Iterator[tuple[int, str, str]]:
    """What came of a verb with each of some lures, and why it failed, if it did."""
    with TemporaryDirectory(prefix="torment-") as name:
        try:
            what, why = _try(verb, Path(name), *_chosen(Path(name), numbers)), ""
        except TrialFailed as error:
            what, why = "failed", str(error).replace(name, "")
    if what == "answered" or len(numbers) == 1:
        yield from ((number, what, why) for number in numbers)
        return
    half = len(numbers) // 2
    yield from _come(verb, numbers[:half])
    yield from _come(verb, numbers[half:])


def each(verb: str, numbers: Sequence[int], first: int) -> Row:
    """What came of a verb with some lures, each once; a seed is `first` and the number of the lure."""
    found = sorted(one for group in _groups(numbers) for one in _come(verb, group))
    failures = {
        str(first + number): record.without_folders(why)[:_SHOWN] for number, what, why in found if what == "failed"
    }
    for why in failures.values():
        print(why, file=sys.stderr, flush=True)
    came = dict(Counter(what for _, what, _ in found))
    seeds = {"failed": failures} if failures else {}
    return Row(EACH, record.commit(), first + numbers[0], first + numbers[-1] + 1, came, seeds)


def hostile_cell(chance: Random, folder: Path) -> str:
    """One field of a cell that leads out of it, opened by one verb."""
    if not is_possible():
        return "no strace"
    verb = chance.choice(list(VERBS))
    return _try(verb, folder, chance.choice(list(lures(folder / _SECRET / "eye.urdf", folder / "cell"))))


def main() -> int:
    """Try everything, or what was not tried yet, print what came of it by verb, and end with 1 after any failure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--only", action="append", choices=list(VERBS))
    parser.add_argument(
        "--record", type=Path, nargs="?", const=record.FILE, help="what was not tried yet, added to this"
    )
    asked = parser.parse_args()
    end, came = time.monotonic() + asked.seconds, dict[str, Counter[str]]()
    for verb, numbers in _left(asked.only or list(VERBS), asked.record):
        if time.monotonic() > end:
            break
        row = each(verb, numbers, list(VERBS).index(verb) * _count())
        came.setdefault(verb, Counter()).update(row.came)
        if asked.record:
            record.write(record.added(record.read(asked.record), row), asked.record)
    print(
        table(("verb", "tried", "answered", "refused", "failed"), [_line(verb, found) for verb, found in came.items()])
    )
    return 1 if any(found["failed"] for found in came.values()) else 0


def _left(verbs: Sequence[str], path: Path | None) -> Iterator[tuple[str, list[int]]]:
    """Verbs with lures that are not recorded yet, some at a time."""
    rows = record.read(path) if path else []
    tried = {seed for row in rows if row.what == EACH for seed in range(row.first, row.end)}
    for verb in verbs:
        first = list(VERBS).index(verb) * _count()
        for start in range(0, _count(), _RECORDED_AT_ONCE):
            numbers = range(start, min(start + _RECORDED_AT_ONCE, _count()))
            if left := [number for number in numbers if first + number not in tried]:
                yield verb, left


def _line(verb: str, came: Counter[str]) -> tuple[object, ...]:
    return verb, came.total(), came["answered"], came["refused"], came["failed"]


if __name__ == "__main__":
    sys.exit(main())
