"""`basecal import poses`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import CycloptsError, Parameter

from basecal.cli.pose_table import PoseTable, import_robot_poses, import_target_poses
from basecal.cli.streams import Inverted, Streams, Unit, import_streams
from basecal.registry import CONTROLLERS

_FORMATS = ", ".join(CONTROLLERS)


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
    streams: bool = False,
    on: str | None = None,
    target_on: str | None = None,
) -> int:
    """Import robots' flange poses as their controllers write them, a robot at a time;
    or make a recording of matrices of all robots and of a target at once.

    A file of one robot is a table with or without a header, separated by commas,
    semicolons, tabs or spaces, or poses as they are pasted from a controller:
    p[...], {X ..., A ...}, [[...],[...]]. Rows belong to the samples that are
    there in order, unless a column `image`, `sample` or `stamp_s` says otherwise;
    where nothing is recorded they make the samples. A robot that is recorded is
    never overwritten. With --camera and --target instead of --robot the table is of
    the target's poses in the camera. With --streams rows keep the times they have
    and make lines of their own: devices that recorded each at its own rate, by its
    own clock; `basecal calibrate` finds by how much the clocks differ.

    For example:

        basecal import poses mycell --robot left left.csv --format ur
        basecal import poses mycell --robot right right.txt --format kuka
        basecal import poses mycell --length-unit mm \\
            --eye-base-from-flange A.txt --hand-base-from-flange C.txt \\
            --camera-from-target B.txt
        basecal import poses mycell --robot arm arm.csv --format ros --streams
        basecal import poses mycell tag.csv --camera wrist --target tag \\
            --on arm --format ros --streams

    Without FILE, pose i of each file belongs to the same instant. A file is
    then 4x4 matrices one below the other (.txt: rows of four numbers), an array
    (n, 4, 4) (.npz, .npz:key, .npy), or a .csv whose header names x, y, z, qx,
    qy, qz, qw or m00 ... m23. Without a hand file the target stands on the
    world; without an eye file the camera does.

    Args:
        cell: Folder of the cell.
        file: Flange poses of one robot, in its base; or a target's in a camera.
        robot: Its name; added to the cell where it is new.
        convention: Whose numbers they are.
        length_unit: What lengths are in; the controller's own unit where not stated.
        deg: Angles are in degrees, where the controller writes radians.
        rad: Angles are in radians, where the controller writes degrees.
        camera_from_target: Poses of the target in the camera.
        eye_base_from_flange: Poses of the flange that carries the camera, in its robot's base.
        hand_base_from_flange: Poses of the flange that carries the target, in its robot's base.
        camera: Name of the camera, where the cell has several, or of the one that saw what a table holds.
        target: Likewise of the target.
        invert: Files that hold the inverse, by the name of their option; a table of a robot is base-from-flange, of a
            target camera-from-target.
        streams: Each row, at its time (column stamp_s, else the first), makes a line of its own.
        on: What carries a camera that is new, with a table of a target: a robot, or world.
        target_on: What carries a target that is new; the world where the camera is on a robot.
    """
    table = None if file is None else PoseTable(file, convention, length_unit, deg, rad, streams)
    if table is not None and robot is None and camera is not None and target is not None:
        from basecal.exchange.importing.seen_poses import Sight

        is_inverted = _is_inverted(invert, "camera-from-target")
        return import_target_poses(cell, table, Sight(camera, target, on, target_on), is_inverted)
    if on is not None or target_on is not None:
        raise CycloptsError(msg="--on and --target-on belong to a table of a target: CELL FILE --camera C --target T")
    if robot is not None or table is not None:
        if robot is None or table is None:
            missing = "--robot" if robot is None else "FILE"
            raise CycloptsError(msg=f"{missing} is missing: CELL --robot NAME FILE")
        return import_robot_poses(cell, robot, table, _is_inverted(invert, "base-from-flange"))
    if streams:
        raise CycloptsError(msg="--streams belongs to a table: CELL --robot NAME FILE, one after the other")
    if camera_from_target is None or length_unit is None:
        missing = "--camera-from-target" if camera_from_target is None else "--length-unit"
        raise CycloptsError(msg=f"{missing} is missing; for one robot's poses: CELL --robot NAME FILE --format FORMAT")
    files = Streams(eye_base_from_flange, hand_base_from_flange, camera_from_target, length_unit, invert)
    return import_streams(cell, files, camera, target)


def _is_inverted(invert: tuple[Inverted, ...], held: Inverted) -> bool:
    """Whether a table holds the inverse of the poses that it is to hold."""
    if others := [each for each in invert if each != held]:
        raise CycloptsError(msg=f"--invert {others[0]}, but no file is given by --{others[0]}: here it is {held}")
    return bool(invert)
