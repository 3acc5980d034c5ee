"""What is read besides cells, damaged by a seed: studies, bags, and what is said to a running cell and by it."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from random import Random
from shutil import copytree
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from basecal.acquisition.capture import PLAN_FILE, remaining_samples
from basecal.acquisition.drivers.simulated import SimulatedCamera, SimulatedRobot
from basecal.cell import Cell
from basecal.cell.files import read_cell, read_plan
from basecal.errors import InputError
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.protocol import Connection, decode, encode
from basecal.simulation.running.server import CellServer
from basecal.simulation.running.two_arms import two_arms
from basecal.studies.chunk import chunk_path, compute_chunk, pack_result, read_chunk, store_chunk
from basecal.studies.study import Study
from basecal.studies.study_file import read_study, study_from_text
from cell_example import CELL, LINES, URDF, journal
from torment.damage import damaged, torn_bytes
from torment.outcome import TrialFailed, run_command, run_reader

Trial = Callable[[Random, Path], str]
_EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "studies").glob("*.yaml"))
_SMALL = "schema: basecal/study/1\ntrials: 4\ncells: 2\nhold: {samples: 4, target: chessboard}\n"
_TOKEN = "open-sesame"
_BAG_FAULTS = 6
_WHOLE = 0.1  # of the chunks, whose checksums tell any damage


def read_damaged_study(chance: Random, folder: Path) -> str:
    """A study's file, its fields or its bytes damaged; what is read is cut into chunks."""
    content = chance.choice(_EXAMPLES).read_bytes()
    if chance.random() < 0.6:
        data = damaged(YAML(typ="safe", pure=True).load(content.decode()), chance)
        content = json.dumps(data).replace("NaN", ".nan").replace("Infinity", ".inf").encode()
    else:
        content = torn_bytes(content, chance)
    (folder / "a.yaml").write_bytes(content)

    def read() -> None:
        study = read_study(folder / "a.yaml")
        if sum(chunk.trials for chunk in study.chunks) != study.trials * len(study.points) or not study.identity:
            raise TrialFailed("trials are lost")

    return run_reader(read)


@cache
def example() -> Cell:
    """The cell that journals are of."""
    with TemporaryDirectory() as name:
        (Path(name) / "cell.yaml").write_text(CELL)
        (Path(name) / "hand.urdf").write_text(URDF)
        return read_cell(name)


@cache
def _chunk() -> tuple[Study, bytes]:
    study = study_from_text(_SMALL, "a.yaml")
    with TemporaryDirectory() as name:
        store_chunk(Path(name), study.chunks[0], pack_result(study, compute_chunk(study, study.chunks[0])))
        return study, chunk_path(Path(name), study.chunks[0]).read_bytes()


def read_damaged_chunk(chance: Random, folder: Path) -> str:
    """What a study has kept of some trials: read as it was written, or not at all."""
    study, content = _chunk()
    path = chunk_path(folder, study.chunks[0])
    path.parent.mkdir()
    path.write_bytes(content if chance.random() < _WHOLE else torn_bytes(content, chance))

    def read() -> None:
        found = read_chunk(folder, study, study.chunks[0])
        if found is None:
            raise InputError("is no chunk")
        if any(len(values) != study.chunks[0].trials for values in vars(found.trials).values()):
            raise TrialFailed("columns of other lengths")

    return run_reader(read)


@cache
def _server() -> CellServer:
    return CellServer(Plant(two_arms("led"), Clock(0)), _TOKEN)


def ask_damaged(chance: Random, folder: Path) -> str:
    """Requests to a running cell, damaged: each gets an answer, and the one after them as if they had not been."""
    server = _server()
    requests: list[dict[str, Any]] = [
        {"do": "state", "robot": "eye"},
        {"do": "move", "robot": "hand", "joints_rad": [0.1] * 6, "speed_rad_s": 0.5},
        {"do": "stop", "robot": "hand"},
        {"do": "light", "on": False},
    ]
    asked = damaged(chance.choice(requests), chance, faults=2)
    line = json.dumps({"token": _TOKEN, **asked} if isinstance(asked, dict) else asked).encode() + b"\n"
    line = torn_bytes(line, chance, faults=1) if chance.random() < 0.3 else line
    came = ""

    def ask() -> None:
        nonlocal came
        said = decode(encode(server.answer(line)))
        came = "answered" if said["ok"] else "refused"
        if not decode(encode(server.answer(encode({"token": _TOKEN, "do": "state", "robot": "hand"}))))["ok"]:
            raise TrialFailed(f"answers no more after {line!r}")

    run_reader(ask)
    return came


def hear_damaged(chance: Random, folder: Path) -> str:
    """Answers of whatever listens at a running cell's port: understood, or refused in words."""
    answer = {"stamp_s": 1.5, "joints_rad": [0.1] * 6, "png_base64": "iVBORw0KGgo="}
    if chance.random() < 0.5:
        del answer["png_base64"]
    else:
        del answer["joints_rad"]
    other = damaged(answer, chance, faults=2)
    said = other if isinstance(other, dict) else {}

    class Line(Connection):
        """A line on which this is said."""

        def ask(self, **request: Any) -> dict[str, Any]:
            return said

    line = Line("", None)  # type: ignore[arg-type]

    def hear() -> None:
        if "png_base64" in answer:
            SimulatedCamera("wrist", line).image()
            return
        reading = SimulatedRobot("eye", line).state()
        if not np.isfinite([reading.stamp_s, *np.ravel(reading.state.joints_rad)]).all():
            raise TrialFailed(f"takes {said}")

    return run_reader(hear)


@cache
def _bags() -> list[Path]:
    from bag_of_cell import BEGIN_S, KINDS, new_bag
    from basecal.geometry import SE3

    made, kept = [], TemporaryDirectory(prefix="torment-")
    _KEPT.append(kept)
    for kind in KINDS:
        (Path(kept.name) / kind).mkdir()
        writer = new_bag(Path(kept.name) / kind, kind)
        for k in range(40):
            moved = SE3.exp(np.array([0.5, 0, 0.1 * (k // 20), 0, 0, 0.5 * (k // 20)]))
            for name in ("/arm/pose", "/tag/pose"):
                writer.pose(name, BEGIN_S + k / 20, moved)
            writer.joints("/joint_states", BEGIN_S + k / 20, ["a", "b"], np.array([0.1, 0.2]))
        made.append(writer.close())
    return made


_KEPT: list[TemporaryDirectory[str]] = []  # until the process ends


def damage_bag(chance: Random, folder: Path) -> Path:
    """A bag of ROS, its bytes damaged."""
    whole = chance.choice(_bags())
    bag = folder / whole.name
    if whole.is_dir():
        copytree(whole, bag)
    else:
        bag.write_bytes(whole.read_bytes())
    files = sorted(path for path in bag.rglob("*") if path.is_file()) or [bag]
    path = chance.choice(files)
    content = path.read_bytes()
    at = chance.choice([0, chance.randrange(len(content))])  # at its start, where it says what it holds, or anywhere
    path.write_bytes(content[:at] + torn_bytes(content[at:], chance, faults=_BAG_FAULTS))
    return bag


def import_damaged_bag(chance: Random, folder: Path) -> str:
    """A damaged bag through `import bag`."""
    if find_spec("rosbags") is None:
        return "no rosbags"
    bag = damage_bag(chance, folder)
    words = ["import", "bag", str(folder / "c"), str(bag), "--robot", "arm=/arm/pose", "--view", "cam,tag=/tag/pose"]
    return run_command([*words, "--on", "cam=world", "tag=arm", *chance.choice(([], ["--streams"], ["--list"]))])[0]


def read_damaged_capture(chance: Random, folder: Path) -> str:
    """What a capture that was cut off left: plan, samples taken and samples given up, one or all of them damaged."""
    (folder / "recording").mkdir(exist_ok=True)
    plan = [{"sample": k, "robots": line["robots"]} for k, line in enumerate(LINES) if "robots" in line]
    given_up = [{"sample": k, "why": "the arm did not come to rest"} for k in range(2)]
    for name, lines in (("plan.jsonl", plan), ("samples.jsonl", list(LINES)), ("given_up.jsonl", given_up)):
        content = journal(*(damaged(line, chance) if chance.random() < 0.4 else line for line in lines))
        content = torn_bytes(content, chance) if chance.random() < 0.3 else content
        (folder / "recording" / name).write_bytes(content)

    def read() -> None:
        left = remaining_samples(folder, example())
        planned = read_plan(folder / PLAN_FILE, folder, example())
        if not {sample.sample for sample in left} <= {sample.sample for sample in planned}:
            raise TrialFailed("what was never planned is to be taken")

    return run_reader(read)


BESIDES: dict[str, Trial] = {
    "capture journal": read_damaged_capture,
    "study": read_damaged_study,
    "study chunk": read_damaged_chunk,
    "requests": ask_damaged,
    "replies": hear_damaged,
}
