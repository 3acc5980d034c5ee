"""Import of touches of marks by a robot's tip, from a table of poses or joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from basecal.cell import TouchObservation
from basecal.cell.cell import grip_name
from basecal.errors import UsageError
from basecal.exchange.columns import read_table_text
from basecal.exchange.controller_poses import read_controller_poses
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.importers.poses import POSE_ADVICE, table_format
from basecal.exchange.importing.imported import (
    Imported,
    KnownCell,
    OneOf,
    PairingMethod,
    Row,
    controller_locations,
    known_cell,
    recorded_samples,
)
from basecal.exchange.importing.text_table import read_text_table, select_robot
from basecal.exchange.joints import joint_model, read_joints
from basecal.exchange.poses import LengthUnit


def read_touches(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    robot: str,
    mark: str | None = None,
    tip: str | None = None,
    meets: str | None = None,
    clamp: str | None = None,
    hinge: bool = False,
    format: Annotated[str | None, OneOf("Controller's format of the poses", tuple(CONTROLLERS))] = None,
    length_unit: LengthUnit | None = None,
    deg: bool = False,
    rad: bool = False,
    joints: bool = False,
    sigma_m: float | None = None,
) -> Imported:
    """Import touches: flange poses of a robot with its tip at a mark.

    The file is a table of poses in a format of `basecal import poses`. With
    --joints it is a table of joints, if the cell has the robot's URDF. A column
    `mark` names the touched mark; with a column `robot`, rows of other robots are
    left out. Each row becomes a sample. New tips and marks are added to the cell
    with unknown positions. With --meets the tip touched the tip of another robot.
    With --clamp this robot and the other robot held a part; with --hinge the part
    can rotate about an axis. Rows of --meets and --clamp are assigned to the
    existing samples in order.

    For example:

        basecal import touches mycell left.txt --robot left --format kuka
        basecal import touches mycell right.txt --robot right --format ur
        basecal import touches mycell all.csv --robot left --format ros \\
            --mark corner
        basecal import touches mycell held.csv --robot right --format ur \\
            --clamp part

    Args:
        cell: Folder of the cell.
        file: Poses or joints, one row per touch.
        robot: Name of the robot; a new robot is added to the cell.
        mark: Mark that all rows touched, if the table has no column `mark`.
        tip: Name of the robot's tip; by default the robot's name and `_tip`.
        meets: Name of the other robot's tip that was touched.
        clamp: Name of the part that this robot and the cell's other robot held.
        hinge: The part rotates about an axis, like a hinge.
        format: Controller's format of the poses.
        length_unit: Unit of lengths; by default the controller's unit.
        deg: Angles, or joints, are in degrees.
        rad: Angles are in radians, although the controller writes degrees.
        joints: The table holds joints.
        sigma_m: Sigma of the distance between tip and mark, per axis [m]; estimated if not given.

    Raises:
        UsageError: if options are inconsistent.
        InputError: if the file cannot be read, or names no marks.
    """
    if sum(each is not None for each in (mark, meets, clamp)) > 1:
        raise UsageError("--mark, --meets and --clamp exclude each other: give one of them")
    own_tip, known, defaults = tip or f"{robot}_tip", known_cell(cell), controller_locations([robot])
    rows, names, how, advice, controller = _read_rows(cell, str(file), robot, joints, (format, length_unit, deg, rad))
    entry: dict[str, Any] = {"robots": {robot: {} if controller is None else {"controller": {"format": controller}}}}
    if clamp is None and own_tip not in known.cameras:
        entry["tips"] = {own_tip: {"on": robot, "offset": {"status": "free"}}}
    if meets is not None:
        contacts = [TouchObservation(own_tip, meets, sigma_m, "tip2")] * len(rows)
        what = f"meetings of {own_tip} and {meets}"
    elif clamp is not None:
        entry["clamp"] = _clamp(known, clamp, robot, hinge)
        contacts = [TouchObservation(clamp, grip_name(clamp), sigma_m, "clamp")] * len(rows)
        what = f"places of {robot} holding {clamp}"
    else:
        marks = touch_names(str(file), names, robot, mark)
        entry["marks"] = {name: {} for name in dict.fromkeys(marks) if name not in known.targets}
        contacts, rows = [TouchObservation(own_tip, name, sigma_m) for name in marks], new_rows(cell, known, rows)
        what = f"touches of {', '.join(dict.fromkeys(marks))} by {own_tip}"
    touched = tuple(replace(row, observations=(touch,)) for row, touch in zip(rows, contacts, strict=True))
    by: PairingMethod | None = "sample" if "marks" in entry else None
    return Imported(str(file), f"{len(rows)} {what}, {how}", touched, entry, defaults=defaults, by=by, advice=advice)


def _read_rows(
    cell: str | Path, path: str, robot: str, is_joints: bool, numbers: tuple[str | None, LengthUnit | None, bool, bool]
) -> tuple[tuple[Row, ...], Sequence[str], str, str, str | None]:
    """Rows of poses or joints, names of the numbers, description, advice, and the controller of poses or None.

    `numbers` are the format, the unit of length, and whether angles are in degrees or in radians.
    """
    notation, length_unit, deg, rad = numbers
    if is_joints:
        chain = joint_model(cell, robot, None, None, None, None).chain
        how = f"{chain.n} joints in {'deg' if deg else 'rad'}"
        advice = "check --deg and the order of the joints"
        return read_joints(path, robot, chain, deg), chain.joint_names, how, advice, None
    pose_format = table_format(path, notation, length_unit, deg, rad)
    rows = read_controller_poses(path, robot, pose_format)
    return (
        rows,
        pose_format.convention.names,
        f"poses as of {pose_format.name} ({pose_format.words})",
        POSE_ADVICE,
        pose_format.name,
    )


def _clamp(context: KnownCell, name: str, robot: str, is_hinge: bool) -> dict[str, Any]:
    """Section `clamp` for a part held by a robot and the cell's only other robot; empty if the part exists."""
    if name in context.cameras:
        return {}
    others = [other for other in context.robots if other != robot]
    if len(others) != 1:
        raise UsageError(f"--clamp needs one other robot in the cell, there are {len(others)}: import its poses first")
    return {name: {"robots": [others[0], robot], "axis": "free" if is_hinge else "fixed"}}


def touch_names(path: str, names: Sequence[str], robot: str, mark: str | None) -> list[str]:
    """Names of the marks that a robot touched, one per row.

    Args:
        path: The file.
        names: Names of the numbers in a row, if the file has no header.
        robot: Robot whose rows are read, if a column names robots.
        mark: Mark that all rows touched, if the file has no column of marks.

    Raises:
        UsageError: if neither a column nor `mark` names the marks, or both do.
    """
    table = select_robot(read_text_table(read_table_text(path, "a table of touches"), path, names), robot)
    marks = table.names("mark", "touch", "point", "target")
    if (marks is None) == (mark is None):
        why = "the table has no column `mark`" if mark is None else "the table has a column `mark`, too"
        raise UsageError(f"{why}: name the touched mark with either --mark or the column")
    return [mark or ""] * len(table.rows) if marks is None else marks


def new_rows(folder: str | Path, cell: KnownCell, rows: Sequence[Row]) -> tuple[Row, ...]:
    """Assign rows without a sample number to new samples after the recorded ones."""
    first = max((sample.sample for sample in recorded_samples(folder, cell)), default=-1) + 1
    return tuple(replace(row, sample=first + k if row.sample is None else row.sample) for k, row in enumerate(rows))
