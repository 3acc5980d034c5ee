"""`basecal import poses`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from cyclopts import CycloptsError, Parameter

from basecal.cli.imported import finish_import, robot_entry
from basecal.cli.streams import Inverted, Streams, Unit, import_streams
from basecal.errors import FrameNotFound
from basecal.registry import CONTROLLERS

_FORMATS = ", ".join(CONTROLLERS)
_METRES = {"m": 1.0, "mm": 1e-3}


def import_poses(
    cell: Path,
    file: str | None = None,
    /,
    *,
    robot: str | None = None,
    convention: Annotated[str | None, Parameter(name="--format", help=f"Whose numbers they are: {_FORMATS}.")] = None,
    length_unit: Unit | None = None,
    deg: bool = False,
    rad: bool = False,
    camera_from_target: str | None = None,
    eye_base_from_flange: str | None = None,
    hand_base_from_flange: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    invert: Annotated[tuple[Inverted, ...], Parameter(consume_multiple=True)] = (),
) -> int:
    """Import robots' flange poses as their controllers write them, a robot at a time;
    or make a recording of matrices of all robots and of a target at once.

    A file of one robot is a table with or without a header, separated by commas,
    semicolons, tabs or spaces, or poses as they are pasted from a controller:
    p[...], {X ..., A ...}, [[...],[...]]. Rows belong to the samples that are
    there in order, unless a column `image`, `sample` or `stamp_s` says otherwise;
    where nothing is recorded they make the samples. A robot that is recorded is
    never overwritten.

    For example:

        basecal import poses mycell --robot left left.csv --format ur
        basecal import poses mycell --robot right right.txt --format kuka
        basecal import poses mycell --length-unit mm \\
            --eye-base-from-flange A.txt --hand-base-from-flange C.txt \\
            --camera-from-target B.txt

    Without --robot, pose i of each file belongs to the same instant. A file is
    then 4x4 matrices one below the other (.txt: rows of four numbers), an array
    (n, 4, 4) (.npz, .npz:key, .npy), or a .csv whose header names x, y, z, qx,
    qy, qz, qw or m00 ... m23. Without a hand file the target stands on the
    world; without an eye file the camera does.

    Args:
        cell: Folder of the cell.
        file: Flange poses of one robot, in its base.
        robot: Its name; added to the cell where it is new.
        convention: Whose numbers they are.
        length_unit: What lengths are in; the controller's own unit where not stated.
        deg: Angles are in degrees, where the controller writes radians.
        rad: Angles are in radians, where the controller writes degrees.
        camera_from_target: Poses of the target in the camera.
        eye_base_from_flange: Poses of the flange that carries the camera, in its robot's base.
        hand_base_from_flange: Poses of the flange that carries the target, in its robot's base.
        camera: Name of the camera, where the cell has several.
        target: Name of the target, where the cell has several.
        invert: Files that hold the inverse, by the name of their option.
    """
    if robot is not None or file is not None:
        return _one_robot(cell, robot, file, convention, length_unit, deg, rad)
    if camera_from_target is None or length_unit is None:
        missing = "--camera-from-target" if camera_from_target is None else "--length-unit"
        raise CycloptsError(msg=f"{missing} is missing; for one robot's poses: CELL --robot NAME FILE --format FORMAT")
    files = Streams(eye_base_from_flange, hand_base_from_flange, camera_from_target, length_unit, invert)
    return import_streams(cell, files, camera, target)


def _one_robot(
    cell: Path, robot: str | None, file: str | None, name: str | None, unit: Unit | None, deg: bool, rad: bool
) -> int:
    from basecal.exchange.controller_poses import Reading, guessed_format, read_controller_poses
    from basecal.exchange.importing.imported import Imported

    if robot is None or file is None:
        raise CycloptsError(msg=f"{'--robot' if robot is None else 'FILE'} is missing: CELL --robot NAME FILE")
    if name is not None and name not in CONTROLLERS:
        raise CycloptsError(msg=f"--format {FrameNotFound(name, CONTROLLERS)}")
    if deg and rad:
        raise CycloptsError(msg="--deg and --rad cannot both be")
    angle = math.radians(1) if deg else 1.0 if rad else None
    reading = Reading(name or guessed_format(file), None if unit is None else _METRES[unit], angle)
    rows = read_controller_poses(file, robot, reading)
    frames = f"{robot}_base_from_{robot}_flange"
    what = f"{len(rows)} poses {frames} as of {reading.name} ({reading.words})"
    imported = Imported(file, what, rows, robot_entry(cell, robot))
    return finish_import(cell, imported, advice="check --length-unit and --format")
