"""Cells to torment, made once, as plain data and as files."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from ruamel.yaml import YAML

from basecal.cell.files import latest_run, read_calibration
from torment.outcome import of_command

_FOLDER = TemporaryDirectory(prefix="torment-")  # removed when the process ends
KINDS = {
    "pose": ["--target", "pose", "--robot-noise-mm", "0.1", "--robot-noise-mrad", "0.2"],
    "charuco": ["--target", "charuco"],
    "led": ["--target", "led", "--mounts", "prior"],
    "points3d": ["--target", "points3d"],
    "joints": ["--joints"],
}


class Made(NamedTuple):
    """A simulated cell: its `cell.yaml` and its samples as plain data, its other files, and its folder with a run."""

    cell: dict[str, Any]
    samples: list[dict[str, Any]]
    urdfs: dict[str, str]
    folder: Path


@cache
def made(kind: str) -> Made:
    """A cell of twelve samples."""
    folder = Path(_FOLDER.name) / kind
    of_command(["simulate", str(folder), "--samples", "12", "--seed", "1", *KINDS[kind]])
    of_command(["calibrate", str(folder)])
    cell = YAML(typ="safe", pure=True).load((folder / "cell.yaml").read_text())
    samples = [json.loads(line) for line in (folder / "recording" / "samples.jsonl").read_text().splitlines()]
    return Made(cell, samples, {path.name: path.read_text() for path in folder.glob("*.urdf")}, folder)


@cache
def calibration(kind: str) -> Any:
    """What its undamaged recording gives."""
    run = latest_run(made(kind).folder)
    assert run is not None
    return read_calibration(run)


def cell_text(cell: Any) -> str:
    """A `cell.yaml` of plain data: JSON, which is YAML."""
    return json.dumps(cell).replace("NaN", ".nan").replace("-Infinity", "-.inf").replace("Infinity", ".inf")


def write(folder: Path, cell: Any, samples: list[Any], urdfs: dict[str, str]) -> None:
    """A cell of plain data."""
    (folder / "recording").mkdir(parents=True, exist_ok=True)
    (folder / "cell.yaml").write_text(cell_text(cell))
    (folder / "recording" / "samples.jsonl").write_text("".join(json.dumps(sample) + "\n" for sample in samples))
    for name, urdf in urdfs.items():
        (folder / name).write_bytes(urdf.encode("utf-8", "surrogatepass"))
