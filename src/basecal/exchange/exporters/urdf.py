"""Export of a robot's URDF with its calibrated joint offsets and link errors."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.cell import Calibration, Cell
from basecal.cell.results.versions import program_version
from basecal.errors import FrameNotFound, InputError
from basecal.exchange.exports.exporter import Exporter, ExportRequest
from basecal.exchange.urdf import corrected_urdf
from basecal.kinematics.urdf import LARGEST_BYTES


def export_text(request: ExportRequest) -> str:
    """Correct the URDF of the requested robot: recorded joints then give the calibrated flange pose.

    Unobservable offsets are set to zero. A comment names the source.

    Raises:
        FrameNotFound: if the robot does not exist.
        InputError: if no robot is named, or it has no URDF or no calibrated parameters. It is also raised if the URDF
            has changed since the calibration, so that a correction is not applied twice.
        DatasetError: if the URDF cannot be used.
    """
    cell, folder, robot = request.cell, request.folder, request.robot
    if cell is None or folder is None:
        raise InputError("a corrected URDF needs the cell and its folder")
    if robot is None:
        raise InputError(f"choose a URDF with --robot: {', '.join(cell.robots)}")
    if robot not in cell.robots:
        raise FrameNotFound(robot, list(cell.robots))
    return corrected_text(cell, folder, request.calibration, robot)


def corrected_text(cell: Cell, folder: Path, calibration: Calibration, name: str) -> str:
    """Correct the URDF of a robot; see `export_text`."""
    robot = cell.robots[name]
    if robot.urdf is None or robot.base_link is None or robot.flange_link is None:
        raise InputError(f"robot {name!r} has no urdf in cell.yaml: there is nothing to correct")
    parameters = calibration.parameters_of_robot(name)
    offsets, links = parameters.get("joint_offsets"), parameters.get("link_parameters")
    if offsets is None and links is None:
        raise InputError(
            f"the latest calibration has no joint offsets of {name!r}: "
            "write `joint_offsets: {status: prior, sigma_rad: 0.005}` there in cell.yaml and calibrate again"
        )
    offsets_rad = None if offsets is None else np.nan_to_num(offsets.values)
    tangents = None if links is None else links.values
    text = read_bounded(folder / robot.urdf, LARGEST_BYTES)
    source = f"sha256:{hashlib.sha256(text).hexdigest()}"
    if calibration.inputs.get(robot.urdf) != source:
        raise InputError(
            f"{robot.urdf} is not the file that was calibrated. It may hold the correction already, which must "
            "not be applied twice. Calibrate again, or restore the file that was calibrated"
        )
    note = f"made by basecal {program_version()} of {source}: {applied_kinds(calibration, name)} applied"
    return corrected_urdf(text, robot.base_link, robot.flange_link, offsets_rad, tangents, note)


def applied_kinds(calibration: Calibration, robot: str) -> str:
    """Names of the corrections of a robot's URDF; empty if there are none."""
    kinds = [kind for kind in ("joint_offsets", "link_parameters") if kind in calibration.parameters_of_robot(robot)]
    return " and ".join(kind.replace("_", " ") for kind in kinds)


EXPORTER = Exporter(
    "with --robot: its URDF with its joint offsets and link errors in the origins of its joints",
    export_text,
    options=("robot",),
)
