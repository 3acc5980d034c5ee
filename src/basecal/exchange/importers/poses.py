"""Import of robots' flange poses, and of target poses in cameras, from tables and files of matrices."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from basecal.errors import DatasetError, FrameNotFound, UsageError, count_text, list_names
from basecal.exchange.controller_poses import PoseFormat, guessed_format, read_controller_poses, read_pose_rows
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.importing.imported import (
    Imported,
    OneOf,
    ViewNames,
    add_target_poses,
    controller_locations,
    known_cell,
    view_entry,
)
from basecal.exchange.poses import LengthUnit, unit_length_m
from basecal.exchange.streams import Inverted, Streams, read_streams

_ONE_ROBOT = "for one robot's poses: CELL --robot NAME FILE --format FORMAT"
_MATRIX_FILES = ("camera_from_target", "eye_base_from_flange", "hand_base_from_flange")
_ROBOT_OPTIONS = ("still", "base_frame", "tool_frame")
POSE_ADVICE = "check --length-unit and --format"
"""Advice if imported poses are implausible."""


def read_poses(
    cell: str | Path,
    file: str | Path | None = None,
    /,
    *,
    robot: str | None = None,
    format: Annotated[str | None, OneOf("Controller's format of the poses", tuple(CONTROLLERS))] = None,
    length_unit: LengthUnit | None = None,
    deg: bool = False,
    rad: bool = False,
    camera_from_target: str | None = None,
    eye_base_from_flange: str | None = None,
    hand_base_from_flange: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    invert: tuple[Inverted, ...] = (),
    streams: bool = False,
    still: bool = False,
    base_frame: str | None = None,
    tool_frame: str | None = None,
    on: str | None = None,
    target_on: str | None = None,
) -> Imported:
    """Import the flange poses of a robot in its controller's format.

    Alternatively, import matrices of all robots and of a target together.

    A file of one robot is a table with or without a header. Commas, semicolons,
    tabs or spaces separate its columns. It may also hold poses copied from a
    controller, p[...], {X ..., A ...}, [[...],[...]], or a whole program with
    them. Rows are assigned to the existing samples in order, unless a column
    `image`, `sample` or `stamp_s` assigns them. If nothing is recorded, they
    become the samples. A recorded robot is overwritten only with --replace. With
    --camera and --target instead of --robot, the table holds the target's poses
    in the camera. With --streams, rows keep their times and become separate
    lines. This is for devices that recorded at their own rates with their own
    clocks. `basecal calibrate` estimates the clock offsets.

    For example:

        basecal import poses mycell --robot left left.csv --format ur
        basecal import poses mycell --robot right right.txt --format kuka
        basecal import poses mycell --robot still still.csv --format ur --still
        basecal import poses mycell --length-unit mm \\
            --eye-base-from-flange A.txt --hand-base-from-flange C.txt \\
            --camera-from-target B.txt
        basecal import poses mycell --robot arm arm.csv --format ros --streams
        basecal import poses mycell tag.csv --camera wrist --target tag \\
            --on arm --format ros --streams

    Without FILE, pose i of each file belongs to sample i. A file then holds 4x4
    matrices below each other (.txt: rows of four numbers), or an array (n, 4, 4)
    (.npz, .npz:key, .npy). A .csv file has a header with x, y, z, qx, qy, qz, qw
    or m00 ... m23. Without a hand file the target is fixed to the world; without
    an eye file the camera is.

    Args:
        cell: Folder of the cell.
        file: Flange poses of one robot in its base, or target poses in a camera.
        robot: Name of the robot; a new robot is added to the cell.
        format: Controller's format of the poses.
        length_unit: Unit of lengths; by default the controller's unit.
        deg: Angles are in degrees, although the controller writes radians.
        rad: Angles are in radians, although the controller writes degrees.
        camera_from_target: Poses of the target in the camera.
        eye_base_from_flange: Poses of the flange that carries the camera, in its robot's base.
        hand_base_from_flange: Poses of the flange that carries the target, in its robot's base.
        camera: Name of the camera, if the cell has several, or of the camera of a table of target poses.
        target: Name of the target, if the cell has several, or of the target of a table of target poses.
        invert: Files that hold inverse poses, by the name of their option. A table of a robot is base-from-flange, a
            table of a target is camera-from-target.
        streams: Each row becomes a separate line at its time (column stamp_s, else the first column).
        still: The robot is at rest: the single row of its file belongs to every sample.
        base_frame: Base frame of the poses in the controller, such as BASE_3; the robot's base if not given.
        tool_frame: Tool frame of the poses in the controller, such as TOOL_1; the flange if not given.
        on: Carrier of a new camera, with a table of target poses: a robot, or world.
        target_on: Carrier of a new target; by default the world if the camera is on a robot.

    Raises:
        UsageError: if options are inconsistent.
        InputError: if a file cannot be read, or is inconsistent with the cell.
    """
    _refuse_unused_options(locals())
    path, pose_format = str(file), None if file is None else table_format(str(file), format, length_unit, deg, rad)
    if pose_format is not None and robot is None and camera is not None and target is not None:
        return _target_poses(cell, ViewNames(camera, target, on, target_on), path, pose_format, streams, invert)
    if on is not None or target_on is not None:
        raise UsageError("--on and --target-on belong to a table of a target: CELL FILE --camera C --target T")
    if (robot is None) != (pose_format is None):
        raise UsageError(f"{'--robot' if robot is None else 'FILE'} is missing: CELL --robot NAME FILE")
    if robot is not None and pose_format is not None:
        imported = _robot_poses(robot, path, pose_format, streams, invert, {"base": base_frame, "tool": tool_frame})
        return replace(imported, is_still=still)
    if streams:
        raise UsageError("--streams needs a table of one robot: CELL --robot NAME FILE; import one robot at a time")
    if camera_from_target is None or length_unit is None:
        raise UsageError(f"--camera-from-target and --length-unit are missing; {_ONE_ROBOT}")
    files = Streams(eye_base_from_flange, hand_base_from_flange, camera_from_target, length_unit, invert)
    return read_streams(cell, files, camera, target)


def _refuse_unused_options(options: Mapping[str, object]) -> None:
    """Raise UsageError if options, by parameter of `read_poses`, have no effect on the kind of files."""
    unused: tuple[str, ...]
    has_file, has_robot = options["file"] is not None, options["robot"] is not None
    if has_file and has_robot:
        noun, unused = "a table of a robot", ("camera", "target", *_MATRIX_FILES)
    elif has_file and options["camera"] is not None and options["target"] is not None:
        noun, unused = "a table of a target", (*_ROBOT_OPTIONS, *_MATRIX_FILES)
    elif not has_file and not has_robot:
        noun, unused = "files of matrices", ("format", "deg", "rad", *_ROBOT_OPTIONS)
    else:  # incomplete
        return
    if names := [f"--{name.replace('_', '-')}" for name in unused if options[name] not in (None, False)]:
        raise UsageError(f"{list_names(names)} has no effect on {noun}: leave it out")


def _is_inverted(invert: tuple[Inverted, ...], direction: Inverted) -> bool:
    """Whether a table holds inverse poses; raises UsageError if `invert` names another file."""
    if others := [each for each in invert if each != direction]:
        raise UsageError(f"--invert {others[0]}, but no file is given with --{others[0]}: here it is {direction}")
    return bool(invert)


def table_format(file: str, format: str | None, unit: LengthUnit | None, deg: bool, rad: bool) -> PoseFormat:
    """Format and units of a table of poses.

    Args:
        file: The file, as named by the user.
        format: Controller's format; guessed from the file if None.
        unit: Unit of lengths; the controller's unit if None.
        deg: Whether angles are in degrees, although the controller writes radians.
        rad: Whether angles are in radians, although the controller writes degrees.

    Raises:
        UsageError: if the format does not exist, or two units of angle are stated.
        DatasetError: if no format is stated and it cannot be guessed.
    """
    name = None if format is None else str(format).lower()
    if name is not None and name not in CONTROLLERS:
        raise UsageError(f"--format {FrameNotFound(name, list(CONTROLLERS))}")
    if deg and rad:
        raise UsageError("--deg and --rad exclude each other")
    angle = math.radians(1) if deg else 1.0 if rad else None
    name = name or guessed_format(file)
    if not name:
        raise DatasetError(file, f"does not state its format: give --format {list_names(list(CONTROLLERS))}")
    return PoseFormat(name, None if unit is None else unit_length_m(unit), angle)


def _robot_poses(
    robot: str,
    file: str,
    pose_format: PoseFormat,
    is_stream: bool,
    invert: tuple[Inverted, ...],
    frames: Mapping[str, str | None],
) -> Imported:
    """Import poses of a robot's flange in its base, or their inverses, with the controller's format and frames."""
    is_inverted = _is_inverted(invert, "base-from-flange")
    rows = read_controller_poses(file, robot, pose_format, is_stream, is_inverted)
    what = _describe(len(rows), f"{robot}_base", f"{robot}_flange", pose_format, is_inverted)
    stated = {name: frame for name, frame in frames.items() if frame is not None}
    entry = {"robots": {robot: {"controller": {"format": pose_format.name, **stated}}}}
    imported = Imported(file, what, rows, entry, is_stream=is_stream, advice=POSE_ADVICE)
    controller = controller_locations([robot])
    return replace(imported, replaced=controller) if stated else replace(imported, defaults=controller)


def _target_poses(
    cell: str | Path,
    names: ViewNames,
    file: str,
    pose_format: PoseFormat,
    is_stream: bool,
    invert: tuple[Inverted, ...],
) -> Imported:
    """Import poses of a target in a camera, or their inverses."""
    is_inverted = _is_inverted(invert, "camera-from-target")
    found = read_pose_rows(file, pose_format, is_stream)
    rows = add_target_poses(found.rows, found.poses.inverse() if is_inverted else found.poses, names)
    what = _describe(len(rows), names.camera, names.target, pose_format, is_inverted)
    advice = f"{POSE_ADVICE}, and whether it takes --invert camera-from-target"
    entry = view_entry(known_cell(cell), names)
    return Imported(file, what, rows, entry, is_stream=is_stream, advice=advice)


def _describe(count: int, parent: str, child: str, pose_format: PoseFormat, is_inverted: bool) -> str:
    """Description of a table's content."""
    transform = f"{child}_from_{parent}, inverted," if is_inverted else f"{parent}_from_{child}"
    return f"{count_text(count, 'pose')} {transform} as of {pose_format.name} ({pose_format.words})"
