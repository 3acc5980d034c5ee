"""Verbs that read two cells or change one, the page of runs, and drivers that read files or a person's lines."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path
from random import Random
from shutil import copytree
from typing import Any

import numpy as np

from basecal.acquisition.driver import Place, Reading
from basecal.acquisition.drivers import folder as folder_driver
from basecal.acquisition.drivers import replay, typed
from basecal.cell import CellCamera, RobotState
from basecal.cell.files import calibration_from_dict, latest_run, read_cell, read_recording
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.reporting.viewing.page import ViewPage
from basecal.vision.image_file import png_bytes
from torment.besides import example
from torment.cells import KINDS, made, write
from torment.damage import HOSTILE_TEXTS, at, damaged, places, torn_bytes
from torment.outcome import TrialFailed, run_command, run_reader
from torment.verbs import files

_WAIT_S = 0.01  # for an image that does not come


def merge_damaged(chance: Random, folder: Path) -> str:
    """Two cells that were recorded apart, one or both of them damaged: merged, or refused without a trace."""
    for name in ("a", "b"):
        kind = chance.choice(list(KINDS))
        cell, samples = made(kind).cell, made(kind).samples
        if chance.random() < 0.6:
            cell = damaged(cell, chance, faults=2)
        if chance.random() < 0.4:
            samples = damaged(samples, chance, faults=2)
        (folder / name).mkdir()
        write(folder / name, cell, samples if isinstance(samples, list) else [samples], made(kind).urdfs)
    what, code, _ = run_command(["merge", str(folder / "a"), str(folder / "b"), "-o", str(folder / "c")])
    if code and (folder / "c").exists():
        raise TrialFailed("what was refused is there by half")
    if not code:
        run_reader(lambda: read_recording(folder / "c", read_cell(folder / "c")))
    return what


def fix_damaged(chance: Random, folder: Path) -> str:
    """A cell with its run, either of them damaged, through `fix`; the files as they were stay readable."""
    cell = folder / "cell"
    copytree(made(chance.choice(list(KINDS))).folder, cell)
    run = latest_run(cell)
    assert run is not None
    path = chance.choice([run / "calibration.json", cell / "recording" / "samples.jsonl"])
    if path.suffix == ".json":
        path.write_text(json.dumps(damaged(json.loads(path.read_text()), chance)))
    else:
        path.write_bytes(torn_bytes(path.read_bytes(), chance))
    return run_command(["fix", str(cell), "--yes"])[0]


def hostile_view(chance: Random, folder: Path) -> str:
    """Texts of a calibration and questions of a browser made hostile: the page of runs gets no element by them."""
    kind = chance.choice(list(KINDS))
    run = latest_run(made(kind).folder)
    assert run is not None
    cell, data = read_cell(made(kind).folder), json.loads((run / "calibration.json").read_text())
    hostile = chance.choice(HOSTILE_TEXTS)
    texts = [place for place in places(data) if place and isinstance(at(data, place), str)]
    for place in chance.sample(texts, min(3, len(texts))):
        at(data, place[:-1])[place[-1]] = hostile
    shown: list[str] = []

    def read() -> None:
        known = calibration_from_dict(data)
        page = ViewPage(cell, read_recording(made(kind).folder, cell), folder, (hostile,), lambda name: known)
        query = {key: chance.choice([hostile, "3,4", "99", "-1"]) for key in ("run", "without", "number")}
        shown.extend([page.page(), page.answer(query), page.sample(query)])

    came = run_reader(read)
    for text in shown:
        if "<img src=x" in text or "<script>alert" in text or 'onerror="' in text:
            raise TrialFailed(f"the page of runs has an element by {hostile!r}")
    return came


def replay_damaged(chance: Random, folder: Path) -> str:
    """A recording to replay, damaged: its states are finite, and it goes where it is sent or says why not."""
    kind = chance.choice(list(KINDS))
    samples = damaged(made(kind).samples, chance)
    (folder / "tape").mkdir()
    lines = samples if isinstance(samples, list) else [samples]
    write(folder / "tape", made(kind).cell, lines, made(kind).urdfs)
    options: Any = damaged({"recording": "tape"}, chance) if chance.random() < 0.2 else {"recording": "tape"}
    cell = read_cell(made(kind).folder)

    def read() -> None:
        place = Place("eye", cell, folder, options if isinstance(options, dict) else {"recording": options})
        robot = replay.open_robot(place)
        _check(robot.state())
        robot.move(robot.state().state, 0.1)
        _check(robot.state())
        replay.open_camera(Place("wrist", cell, folder, place.options)).image()

    return run_reader(read)


def typed_damaged(chance: Random, folder: Path) -> str:
    """Lines that a person types, torn: a finite state, or the question again until the input ends."""
    notation = chance.choice([*CONTROLLERS, "joints_deg"])
    line = " ".join(str(round(chance.uniform(-500, 500), 3)) for _ in range(chance.choice([3, 6, 6, 7])))
    text = torn_bytes(line.encode(), chance).decode(errors="replace")
    lines = io.StringIO(f"{text}\n{chance.choice(HOSTILE_TEXTS)}\n{line}\n")

    def read() -> None:
        with contextlib.redirect_stderr(io.StringIO()):
            _check(typed.TypedRobot(Place("hand", example(), folder), notation, lines).state())

    return run_reader(read)


def folder_damaged(chance: Random, folder: Path) -> str:
    """Images in a folder, torn: an image, or none in time."""
    cell = example()
    camera: CellCamera = next(iter(cell.cameras.values()))
    grey = np.zeros((camera.size_px or (32, 24))[::-1], dtype=np.uint8)
    (folder / "saved").mkdir()
    for number in range(3):
        content = png_bytes(grey)
        name = chance.choice(["a{}.png", "b {}.PNG", "{}.txt", ".{}.png"]).format(number)
        (folder / "saved" / name).write_bytes(torn_bytes(content, chance) if chance.random() < 0.8 else content)
    options = {"path": "saved", "wait_s": _WAIT_S, "existing": chance.random() < 0.8}

    def read() -> None:
        found = folder_driver.open_camera(Place(camera.name, cell, folder, options)).image()
        if not np.isfinite(found.stamp_s) or found.grey.ndim != 2:
            raise TrialFailed(f"gives an image of shape {found.grey.shape}")

    return run_reader(read)


def hostile_demo(chance: Random, folder: Path) -> str:
    """A folder that says that a demo made it, and leads elsewhere by a link: nothing there is written or removed."""
    outside, cell = folder / "outside", folder / "cell"
    cell.mkdir()
    (outside / "images").mkdir(parents=True)
    for name in ("samples.jsonl", "plan.jsonl", "cell.yaml"):
        (outside / name).write_text("precious")
    before = files(outside)
    if chance.random() < 0.8:
        (cell / ".made-by-basecal-demo").touch()
    name = chance.choice(["recording", "runs", "derived", "cell.yaml", "truth.yaml", "recording/images"])
    (cell / name).parent.mkdir(exist_ok=True)
    (cell / name).symlink_to(outside / name if name == "cell.yaml" else outside)
    what = run_command(["demo", str(cell), *chance.choice(([], ["--led"], ["--json"]))])[0]
    if files(outside) != before:
        raise TrialFailed(f"the demo follows the link {name}")
    return what


def _check(reading: Reading) -> None:
    state: RobotState = reading.state
    numbers = state.joints_rad if state.base_from_flange is None else state.base_from_flange.matrix
    if not np.all(np.isfinite(np.append(np.ravel(np.asarray(numbers)), reading.stamp_s))):
        raise TrialFailed(f"gives {state}")


OTHERS = {
    "merge": merge_damaged,
    "fix": fix_damaged,
    "demo": hostile_demo,
    "view": hostile_view,
    "driver replay": replay_damaged,
    "driver typed": typed_damaged,
    "driver folder": folder_damaged,
}
