"""Small correct cells, as folders to which a mistake is applied."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from basecal.cell import Unknown
from basecal.cell.files import write_cell, write_recording
from basecal.cell.format.yaml_text import parse_yaml, yaml_text
from basecal.cell.targets.charuco import charuco_target
from basecal.cli.simulate import write_simulation
from basecal.geometry import Camera
from basecal.simulation import Scenario, SimulatedCell, simulate
from basecal.simulation.images import render_recording

Line = dict[str, Any]
BOARD = charuco_target((6, 8), 0.03, 0.022, "DICT_5X5_100")
LENS = Camera("pinhole", np.array([520.0, 522.0, 318.0, 242.0, 0.0, 0.0, 0.0, 0.0, 0.0]), (640, 480))


def lines_of(folder: Path) -> list[Line]:
    """Recorded samples as JSON objects."""
    return [json.loads(text) for text in samples_file(folder).read_text().splitlines()]


def write_lines(folder: Path, lines: list[Line]) -> None:
    """Replace the recorded samples."""
    samples_file(folder).write_text("".join(json.dumps(line) + "\n" for line in lines))


def samples_file(folder: Path) -> Path:
    """Path of the recorded samples."""
    return folder / "recording" / "samples.jsonl"


def change_cell(folder: Path, change: Callable[[Any], object]) -> None:
    """Change the data of `cell.yaml` in place."""
    path = folder / "cell.yaml"
    data = parse_yaml(path.read_text(), str(path)).data
    change(data)
    path.write_text(yaml_text(data))


def images(folder: Path) -> list[Path]:
    """Paths of the images in order."""
    return sorted((folder / "recording" / "images").glob("*/*.png"))


def _dual(**kept: Any) -> Callable[[Path], None]:
    return lambda folder: _write(folder, simulate(Scenario(samples=15, **kept), 0))


def _write(folder: Path, made: SimulatedCell) -> None:
    write_simulation(folder, made)


def _stated_mount(folder: Path) -> None:
    """Write a cell that states the true camera mount as fixed."""
    made = simulate(Scenario(samples=15), 0)
    name = made.cell.mount_name("wrist")
    camera = replace(made.cell.cameras["wrist"], mount=Unknown("fixed", made.truth[name]))
    _write(folder, replace(made, cell=replace(made.cell, cameras={"wrist": camera})))


def _rendered(folder: Path) -> None:
    """Write a cell with two arms and eight images of a board."""
    scenario = Scenario(samples=8, camera=LENS, board=BOARD, distance_m=(0.4, 0.6), state_pixel_noise=False)
    made = simulate(scenario, 2)
    write_cell(made.cell, folder)
    write_recording(render_recording(made, folder), folder)


CELLS: dict[str, Callable[[Path], None]] = {
    "board": _dual(),
    "joints": _dual(joints=True),
    "poses": _dual(target="pose"),
    "one robot": _dual(layout="eye_in_hand"),
    "one robot poses": _dual(layout="eye_in_hand", target="pose"),
    "stated mount": _stated_mount,
    "pictures": _rendered,
}
"""By what is recorded, or how."""
