"""Provenance of an answer: data, program and settings."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.cell import Calibration, Cell

Rows = Mapping[str, str]
_WORDS = {"None": "none", "True": "yes", "False": "no"}


def provenance(cell: Cell, calibration: Calibration) -> dict[str, Rows]:
    """Tables by their headings: files, versions of programs, statuses of what the cell holds, settings."""
    lenses = {name: camera.intrinsics for name, camera in cell.cameras.items() if camera.intrinsics is not None}
    known = {
        **{name: unknown.status for name, unknown in cell.transforms.items()},
        **{f"intrinsics of {name}": intrinsics.status for name, intrinsics in lenses.items()},
        **{f"noise of {name}": _noise(name, cell, calibration) for name in cell.robots},
        **{
            f"{kind.replace('_', ' ')} of {name}": of.status
            for name, robot in cell.robots.items()
            for kind, of in robot.parameters.items()
        },
    }
    number = {} if calibration.condition is None else {"condition number": f"{calibration.condition:.3g}"}
    used = {key: _WORDS.get(str(value), str(value)) for key, value in calibration.settings.items()}
    tables = {
        "Files": calibration.inputs,
        "Programs": calibration.versions,
        "What was known": known,
        "Settings": {**used, **number},
    }
    return {heading: rows for heading, rows in tables.items() if rows}


def _noise(robot: str, cell: Cell, calibration: Calibration) -> str:
    """Where the sigmas of a robot's poses come from."""
    if cell.robots[robot].noise is not None:
        return "stated"
    if robot in (calibration.noise.get("robots") or {}):
        return "estimated"
    return "not estimated" if calibration.settings.get("robot_noise") == "estimated" else "none, assumed exact"
