"""What verbs start from: cells of several kinds, and files beside them."""

from __future__ import annotations

import copy
import json
from functools import cache
from pathlib import Path
from shutil import copytree, rmtree

import numpy as np
from ruamel.yaml import YAML

from basecal.cell.files import read_truth
from basecal.geometry import SE3
from basecal.vision.image_file import png_bytes
from torment.cells import cell_text, made, write
from torment.outcome import run_command

POSES = 5
PHOTOS = 2
_PIXELS = 12  # of each sample


def unrecorded(folder: Path) -> None:
    """A cell without a recording, pixels and a photo for it."""
    copytree(folder / "cell", folder / "unrecorded")
    (folder / "unrecorded" / "recording" / "samples.jsonl").unlink()
    rows = [f"{sample},{point},{100 + point},{200 + sample}" for sample in range(POSES) for point in range(_PIXELS)]
    (folder / "pixels.csv").write_text("\n".join(["sample,id,u,v", *rows, ""]))
    (folder / "photos").mkdir()
    (folder / "photos" / "0.png").write_bytes(png_bytes(np.zeros((720, 1280), dtype=np.uint8)))


def replayed(folder: Path) -> None:
    """A cell whose arms and camera go through a recording again, and a plan of that."""
    cell, known = folder / "cell", read_truth(folder / "cell")
    copytree(cell, cell / "tape")
    described = YAML(typ="safe", pure=True).load((cell / "cell.yaml").read_text())
    for each in (*described["robots"].values(), *described["cameras"].values()):
        each["driver"] = {"kind": "replay", "recording": "tape"}
    for entry, transform in (
        (described["bases"]["hand"], "eye_base_from_hand_base"),
        (described["cameras"]["wrist"]["mount"], "eye_flange_from_wrist"),
        (described["targets"]["board"]["mount"], "hand_flange_from_board"),
    ):
        entry["guess"] = {"t_m": known[transform].translation.tolist(), "q_xyzw": known[transform].quaternion.tolist()}
    (cell / "cell.yaml").write_text(cell_text(described))
    samples = [json.loads(line) for line in (cell / "recording" / "samples.jsonl").read_text().splitlines()]
    plan = [{"sample": sample["sample"], "robots": sample["robots"]} for sample in samples]
    (folder / "plan.jsonl").write_text("".join(json.dumps(line) + "\n" for line in plan))
    rmtree(cell / "recording")


def with_bag(folder: Path) -> None:
    """A bag of ROS in which an arm and a tag stand at two places."""
    from bag_of_cell import BEGIN_S, new_bag

    writer = new_bag(folder, "sqlite3")
    for k in range(40):
        moved = SE3.exp(np.array([0.5, 0, 0.1 * (k // 20), 0, 0, 0.5 * (k // 20)]))
        for name in ("/arm/pose", "/tag/pose"):
            writer.pose(name, BEGIN_S + k / 20, moved)
    writer.close().rename(folder / "bag")


def with_dataset(folder: Path) -> None:
    """A cell without a recording, and a dataset of LeRobot for it."""
    from exchange.test_lerobot import dataset

    unrecorded(folder)
    dataset(folder / "dataset", [*(f"motor{k}" for k in range(6)), "gripper"])


def with_study(folder: Path) -> None:
    """A small study."""
    (folder / "a.yaml").write_text("schema: basecal/study/1\ntrials: 2\ncells: 1\nhold: {samples: 4, target: led}\n")


@cache
def _inverted() -> Path:
    """A calibrated cell whose hand was recorded inverted."""
    folder = made("pose").folder.parent / "inverted"
    samples = copy.deepcopy(made("pose").samples)
    for sample in samples:
        pose = sample["robots"]["hand"]["base_from_flange"]
        found = SE3.from_quaternion(pose["q_xyzw"], pose["t_m"]).inverse()
        pose |= {"t_m": found.translation.tolist(), "q_xyzw": found.quaternion.tolist()}
    write(folder, made("pose").cell, samples, {})
    run_command(["calibrate", str(folder)])
    return folder


@cache
def start_cell(kind: str) -> Path:
    """A cell of a kind of `cells.KINDS`; `images` of one whose camera took images, `inverted` of one to fix."""
    if kind == "inverted":
        return _inverted()
    if kind != "images":
        return made(kind).folder
    folder = made("charuco").folder.parent / "images"
    run_command(["simulate", str(folder), "--samples", str(PHOTOS), "--images"])
    return folder
