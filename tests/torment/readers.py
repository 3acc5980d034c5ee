"""Readers on damaged files: what is damaged by a seed, and read in this process."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import cv2
import numpy as np

from basecal.cell import Cell
from basecal.cell.files import latest_run, read_calibration, read_cell, read_recording, read_truth
from basecal.errors import InputError
from basecal.exchange.controller_poses import read_poses
from basecal.exchange.streams import read_pixels
from basecal.kinematics import read_chain
from basecal.reporting.text import text_report
from basecal.vision.image_file import grey_image, read_bytes
from cell_example import CELL, LINES, URDF, journal
from torment.besides import BESIDES, example
from torment.cells import KINDS, cell_text, made
from torment.damage import ODD_NUMBERS, damaged, torn, torn_bytes
from torment.foreign import FOREIGN
from torment.outcome import TrialFailed, run_reader

Trial = Callable[[Random, Path], str]
_KEPT = 0.3  # of the example's cameras and targets
_IMAGE = np.random.default_rng(0).integers(0, 256, (18, 24, 3), dtype=np.uint8)
_START_BYTES = 64  # in which images say their size and how they are stored


def read_damaged_cell(chance: Random, folder: Path) -> str:
    """`cell.yaml`, its fields or its bytes damaged."""
    if chance.random() < 0.5:
        content = cell_text(damaged(made(chance.choice(list(KINDS))).cell, chance)).encode()
    else:
        content = torn_bytes(_part_of_the_example(chance).encode(), chance)
    (folder / "cell.yaml").write_bytes(content)
    (folder / "hand.urdf").write_text(URDF)
    return run_reader(lambda: read_cell(folder))


def _part_of_the_example(chance: Random) -> str:
    """The example without most of its cameras and targets, which take long to parse."""
    entries = re.split(r"(?m)^(?=\S|  \S)", CELL)
    optional = ("  wrist", "  hall", "  depth", "  board", "  light", "  tags", "  unseen")
    return "".join(entry for entry in entries if not entry.startswith(optional) or chance.random() < _KEPT)


def read_damaged_recording(chance: Random, folder: Path) -> str:
    """`samples.jsonl`, its fields or its bytes damaged."""
    (folder / "recording").mkdir(exist_ok=True)
    lines = [damaged(line, chance) if chance.random() < 0.6 else line for line in LINES]
    content = journal(*lines)
    content = torn_bytes(content, chance) if chance.random() < 0.4 else content
    (folder / "recording" / "samples.jsonl").write_bytes(content)
    return run_reader(lambda: read_recording(folder, example()))


def read_damaged_calibration(chance: Random, folder: Path) -> str:
    """`calibration.json`; what is read is reported as text."""
    cell, content, data = _written(chance.choice(list(KINDS)))
    path = folder / "calibration.json"
    if chance.random() < 0.7:
        path.write_text(json.dumps(damaged(data, chance)))
    else:
        path.write_bytes(torn_bytes(content, chance))
    return run_reader(lambda: text_report(cell, read_calibration(path)))


@cache
def _written(kind: str) -> tuple[Cell, bytes, Any]:
    """A cell, and its calibration as it is written and as plain data."""
    run = latest_run(made(kind).folder)
    assert run is not None
    content = (run / "calibration.json").read_bytes()
    return read_cell(made(kind).folder), content, json.loads(content)


def read_damaged_truth(chance: Random, folder: Path) -> str:
    """`truth.yaml`."""
    content = (made("pose").folder / "truth.yaml").read_bytes()
    (folder / "truth.yaml").write_bytes(torn_bytes(content, chance))
    return run_reader(lambda: read_truth(folder))


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
    return run_reader(lambda: read_chain(folder / "a.urdf", "base_link", "tool0"))


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
    return run_reader(lambda: read_poses(path, chance.choice(["m", "mm"])))


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
    return run_reader(lambda: read_pixels(path))


@cache
def _encoded(suffix: str) -> bytes:
    return bytes(cv2.imencode(suffix, _IMAGE[..., 0] if suffix == ".pgm" else _IMAGE)[1])


def read_damaged_image(chance: Random, folder: Path) -> str:
    """A small image, its start or any of its bytes damaged: pixels of its own size, or why there are none."""
    content = _encoded(chance.choice([".png", ".jpg", ".bmp", ".tiff", ".webp", ".pgm", ".ppm"]))
    cut = chance.choice([_START_BYTES, len(content)])
    path = folder / "image"
    path.write_bytes(torn_bytes(content[:cut], chance) + content[cut:])
    size_px = chance.choice([None, (24, 18)])

    def read() -> None:
        data = read_bytes(path)
        image = data if isinstance(data, str) else grey_image(data, size_px)
        if isinstance(image, str):
            raise InputError(image)
        if image.ndim != 2 or (size_px and image.shape != size_px[::-1]):
            raise TrialFailed(f"an image of {image.shape}")

    return run_reader(read)


READERS: dict[str, Trial] = {
    "cell.yaml": read_damaged_cell,
    "samples.jsonl": read_damaged_recording,
    "calibration.json": read_damaged_calibration,
    "truth.yaml": read_damaged_truth,
    "URDF": read_damaged_urdf,
    "poses": read_damaged_poses,
    "pixels": read_damaged_pixels,
    "image": read_damaged_image,
    **FOREIGN,
    **BESIDES,
}
