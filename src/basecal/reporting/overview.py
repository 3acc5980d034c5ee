"""Overview of a calibration for non-experts: requested transforms, time, devices, and provenance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import PurePosixPath
from typing import Any

from basecal.cell import WORLD, Calibration, Cell, CellCamera, CellTarget

_LENS_PHRASES = {"fixed": "lens as stated", "prior": "lens stated and refined", "free": "lens estimated"}
Rows = Mapping[str, str]
_WORDS = {"None": "none", "True": "yes", "False": "no"}


def answer_words(cell: Cell, time: datetime | None) -> Iterator[tuple[str, str]]:
    """Time of the calibration, UTC, and the requested transforms: a heading and a text each."""
    if time is not None:
        yield "Calibrated", f"{time:%A} {time.day} {time:%B %Y, %H:%M} UTC"
    for name in cell.requested_transforms:
        parent, _, child = name.partition("_from_")
        yield "Requested", f"where {child} is, seen from {parent}"


def cell_words(cell: Cell) -> Iterator[tuple[str, str]]:
    """Robots, cameras and targets: a heading and a text each."""
    for robot in cell.robots.values():
        recorded = "poses recorded" if robot.chain is None else "joints recorded"
        model = "" if robot.urdf is None else f", {PurePosixPath(robot.urdf).name}"
        reference = ", the reference" if robot.name == cell.reference else ""
        yield "Robot", f"{robot.name}{reference}, {recorded}{model}"
    for camera in cell.cameras.values():
        size = "" if camera.size_px is None else f", {camera.size_px[0]} x {camera.size_px[1]} px"
        lens = "" if camera.intrinsics is None else f", {camera.model}, {_LENS_PHRASES[camera.intrinsics.status]}"
        yield "Camera", f"{_location(camera)}{size}{lens}"
    for entry in cell.targets.values():
        shape = entry.target
        words = ["seen as poses"] if shape is None else [shape.kind, *_options(shape.options)]
        yield "Target", f"{_location(entry)}, {', '.join(words)}"


def _location(body: CellCamera | CellTarget) -> str:
    return f"{body.name}, {'beside the robots' if body.on == WORLD else f'on the flange of {body.on}'}"


def _options(options: Mapping[str, Any]) -> Iterator[str]:
    """Fields of `cell.yaml` as text: lengths in mm, columns and rows, names; for other lists their length."""
    for key, value in options.items():
        name = key.removesuffix("_m").replace("_", " ")
        if isinstance(value, bool):
            if value:
                yield name
        elif isinstance(value, int | float):
            yield f"{name} {1e3 * value:g} mm" if key.endswith("_m") else f"{name} {value:g}"
        elif isinstance(value, str):
            yield value
        elif len(value) == 2 and all(isinstance(each, int) for each in value):
            yield f"{value[0]} x {value[1]} {name}"
        else:
            yield f"{len(value)} {name}" if len(value) != 1 else f"1 {name.removesuffix('s')}"


def provenance(cell: Cell, calibration: Calibration) -> dict[str, Rows]:
    """Tables by heading: files, versions of programs, statuses of the cell's parameters, settings."""
    lenses = {name: camera.intrinsics for name, camera in cell.cameras.items() if camera.intrinsics is not None}
    statuses = {
        **{name: unknown.status for name, unknown in cell.transforms.items()},
        **{f"intrinsics of {name}": intrinsics.status for name, intrinsics in lenses.items()},
        **{f"noise of {name}": _noise(name, cell, calibration) for name in cell.robots},
        **{
            f"{kind.replace('_', ' ')} of {name}": parameters.status
            for name, robot in cell.robots.items()
            for kind, parameters in robot.parameters.items()
        },
    }
    number = {} if calibration.condition is None else {"condition number": f"{calibration.condition:.3g}"}
    used = {key: _WORDS.get(str(value), str(value)) for key, value in calibration.settings.items()}
    tables = {
        "Files": calibration.inputs,
        "Programs": calibration.versions,
        "What was known": statuses,
        "Settings": {**used, **number},
    }
    return {heading: rows for heading, rows in tables.items() if rows}


def _noise(robot: str, cell: Cell, calibration: Calibration) -> str:
    """Source of the sigmas of a robot's poses."""
    if cell.robots[robot].noise is not None:
        return "stated"
    if robot in (calibration.noise.get("robots") or {}):
        return "estimated"
    return "not estimated" if calibration.settings.get("robot_noise") == "estimated" else "none, assumed exact"
