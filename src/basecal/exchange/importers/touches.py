"""Touches of marks by a robot's tip, from a table of its poses or joints."""

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
from basecal.exchange.importers.poses import POSE_ADVICE, table_reading
from basecal.exchange.importing.imported import (
    By,
    Imported,
    KnownCell,
    OneOf,
    Row,
    controller_places,
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
    format: Annotated[str | None, OneOf("Whose numbers they are", tuple(CONTROLLERS))] = None,
    length_unit: LengthUnit | None = None,
    deg: bool = False,
    rad: bool = False,
    joints: bool = False,
    sigma_m: float | None = None,
) -> Imported:
    """Import touches: where a robot's flange was when its tip was at a mark.

    The file is a table of poses as `basecal import poses` takes them, or with
    --joints of joints, of a robot whose URDF the cell has. A column `mark` names
    what was touched; where there is a column `robot`, rows of others are left out.
    Each row makes a sample. Tips and marks that are new are added to the cell:
    nothing need be known of them. With --meets the tip met that of another robot.
    With --clamp this robot and the other one held a part, with --hinge one that
    turns about an axis. Both are at the samples that are there, in order.

    For example:

        basecal import touches mycell left.txt --robot left --format kuka
        basecal import touches mycell right.txt --robot right --format ur
        basecal import touches mycell all.csv --robot left --format ros \\
            --mark corner
        basecal import touches mycell held.csv --robot right --format ur \\
            --clamp part

    Args:
        cell: Folder of the cell.
        file: Poses or joints, a row for each touch.
        robot: Its name; added to the cell where it is new.
        mark: What all rows touched, where the table has no column `mark`.
        tip: Name of the robot's tip; the robot's name and `_tip` where left out.
        meets: Tip of another robot that this one met.
        clamp: Name of a part that this robot and the other one of the cell held.
        hinge: The part turns about an axis, as a hinge does.
        format: Whose numbers they are.
        length_unit: What lengths are in; the controller's own unit where not stated.
        deg: Angles, or joints, are in degrees.
        rad: Angles are in radians, where the controller writes degrees.
        joints: The table holds joints.
        sigma_m: How well tips and marks meet, per axis [m]; estimated where left out.

    Raises:
        UsageError: if options do not go together.
        InputError: if the file cannot be read, or names no marks.
    """
    if sum(each is not None for each in (mark, meets, clamp)) > 1:
        raise UsageError("--mark, --meets and --clamp exclude one another: say what the robot touched")
    own_tip, known, places = tip or f"{robot}_tip", known_cell(cell), controller_places([robot])
    rows, names, how, advice, writer = _read_rows(cell, str(file), robot, joints, (format, length_unit, deg, rad))
    entry: dict[str, Any] = {"robots": {robot: {} if writer is None else {"controller": {"format": writer}}}}
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
        contacts, rows = [TouchObservation(own_tip, at, sigma_m) for at in marks], new_rows(cell, known, rows)
        what = f"touches of {', '.join(dict.fromkeys(marks))} by {own_tip}"
    touched = tuple(replace(row, observations=(seen,)) for row, seen in zip(rows, contacts, strict=True))
    by: By | None = "sample" if "marks" in entry else None
    return Imported(str(file), f"{len(rows)} {what}, {how}", touched, entry, defaults=places, by=by, advice=advice)


def _read_rows(
    cell: str | Path, path: str, robot: str, is_joints: bool, numbers: tuple[str | None, LengthUnit | None, bool, bool]
) -> tuple[tuple[Row, ...], Sequence[str], str, str, str | None]:
    """Rows of poses or joints, the names of their numbers, how they were read, what to check, and whose poses."""
    notation, length_unit, deg, rad = numbers
    if is_joints:
        chain = joint_model(cell, robot, None, None, None, None).chain
        how = f"{chain.n} joints in {'deg' if deg else 'rad'}"
        advice = "check --deg and the order of the joints"
        return read_joints(path, robot, chain, deg), chain.joint_names, how, advice, None
    reading = table_reading(path, notation, length_unit, deg, rad)
    rows = read_controller_poses(path, robot, reading)
    return rows, reading.convention.names, f"poses as of {reading.name} ({reading.words})", POSE_ADVICE, reading.name


def _clamp(context: KnownCell, name: str, robot: str, is_hinge: bool) -> dict[str, Any]:
    """The section `clamp` with a part that a robot and the only other one hold."""
    if name in context.cameras:
        return {}
    others = [other for other in context.robots if other != robot]
    if len(others) != 1:
        raise UsageError(f"--clamp needs one other robot in the cell, there are {len(others)}: import its poses first")
    return {name: {"robots": [others[0], robot], "axis": "free" if is_hinge else "fixed"}}


def touch_names(path: str, names: Sequence[str], robot: str, mark: str | None) -> list[str]:
    """The marks that a robot touched, one for each of its rows.

    Args:
        path: The file.
        names: Of the numbers of its rows where it has no header.
        robot: Whose rows are read where a column names robots.
        mark: What all touched, if the file does not say.

    Raises:
        UsageError: if neither a column nor `mark` says what was touched, or both do.
    """
    table = select_robot(read_text_table(read_table_text(path, "a table of touches"), path, names), robot)
    marks = table.names("mark", "touch", "point", "target")
    if (marks is None) == (mark is None):
        why = "the table has no column `mark`" if mark is None else "the table has a column `mark`, too"
        raise UsageError(f"{why}: say by --mark or by the column what was touched")
    return [mark or ""] * len(table.rows) if marks is None else marks


def new_rows(folder: str | Path, cell: KnownCell, rows: Sequence[Row]) -> tuple[Row, ...]:
    """Rows that are samples of their own, after those that are recorded; numbers that rows have stay."""
    first = max((sample.sample for sample in recorded_samples(folder, cell)), default=-1) + 1
    return tuple(replace(row, sample=first + k if row.sample is None else row.sample) for k, row in enumerate(rows))
