"""Cells to torment, made once, as plain data and as files."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from ruamel.yaml import YAML
from scipy.stats import chi2

from basecal.cell.files import calibration_from_dict, latest_run, read_calibration
from torment.outcome import run_command

_FOLDER = TemporaryDirectory(prefix="torment-")  # removed when the process ends
_FAR = float(chi2.ppf(0.999, 6))  # squared sigmas of a base beyond its 99.9 % ellipsoid
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
    run_command(["simulate", str(folder), "--samples", "12", "--seed", "1", *KINDS[kind]])
    run_command(["calibrate", str(folder)])
    cell = YAML(typ="safe", pure=True).load((folder / "cell.yaml").read_text())
    samples = [json.loads(line) for line in (folder / "recording" / "samples.jsonl").read_text().splitlines()]
    return Made(cell, samples, {path.name: path.read_text() for path in folder.glob("*.urdf")}, folder)


@cache
def calibration(kind: str) -> Any:
    """What its undamaged recording gives."""
    run = latest_run(made(kind).folder)
    assert run is not None
    return read_calibration(run)


def moved_or_good(kind: str, answer: dict[str, Any]) -> str:
    """`good and moved` where a good answer's base is beyond its ellipsoid from that of the undamaged recording."""
    for name, before in calibration(kind).transforms.items():
        if "_base_from_" not in name or name not in answer["transforms"]:
            continue
        now = calibration_from_dict(answer)[name]
        off = (now.mean.inverse() @ before.mean).log()
        if off @ np.linalg.pinv(now.covariance + before.covariance) @ off > _FAR:
            return "good and moved"
    return "good"


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
