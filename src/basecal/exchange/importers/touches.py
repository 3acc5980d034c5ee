"""Touches of marks by a robot's tip, from a table of its poses or joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from basecal.cell import TouchObservation
from basecal.errors import UsageError
from basecal.exchange.controller_poses import read_controller_poses
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.importers.poses import POSE_ADVICE, PoseTable
from basecal.exchange.importing.imported import Imported, OneOf, Row
from basecal.exchange.importing.joint_model import joint_model
from basecal.exchange.importing.known import known_cell
from basecal.exchange.joints import read_joints
from basecal.exchange.poses import LengthUnit
from basecal.exchange.touch_table import TouchTable, new_rows, touch_names


def read_touches(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    robot: str,
    mark: str | None = None,
    tip: str | None = None,
    meets: str | None = None,
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
    nothing need be known of them. With --meets the tip met that of another robot,
    at the samples that are there, in order.

    For example:

        basecal import touches mycell left.txt --robot left --format kuka
        basecal import touches mycell right.txt --robot right --format ur
        basecal import touches mycell all.csv --robot left --format ros --mark corner

    Args:
        cell: Folder of the cell.
        file: Poses or joints, a row for each touch.
        robot: Its name; added to the cell where it is new.
        mark: What all rows touched, where the table has no column `mark`.
        tip: Name of the robot's tip; the robot's name and `_tip` where left out.
        meets: Tip of another robot that this one met.
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
    if meets is not None and mark is not None:
        raise UsageError("--mark and --meets cannot both be: a tip was at a mark, or at another tip")
    own_tip, known = tip or f"{robot}_tip", known_cell(cell)
    entry: dict[str, Any] = {"robots": {robot: {}}}
    if known is None or own_tip not in known.cameras:
        entry["tips"] = {own_tip: {"on": robot, "offset": {"status": "free"}}}
    if joints:
        chain = joint_model(cell, robot, None, None, None, None).chain
        rows, names = read_joints(str(file), robot, chain, deg), chain.joint_names
        how, advice = f"{chain.n} joints in {'deg' if deg else 'rad'}", "check --deg and the order of the joints"
    else:
        reading = PoseTable(str(file), format, length_unit, deg, rad, False).reading
        rows, names = read_controller_poses(str(file), robot, reading), reading.convention.names
        how, advice = f"poses as of {reading.name} ({reading.words})", POSE_ADVICE
    if meets is not None:
        what = f"{len(rows)} meetings of {own_tip} and {meets}, {how}"
        seen = _with_touches(rows, own_tip, [meets] * len(rows), sigma_m, True)
        return Imported(str(file), what, seen, entry, advice=advice)
    table = TouchTable(str(file), names)
    kept, marks = touch_names(table, rows, robot, mark)
    entry["marks"] = {name: {} for name in dict.fromkeys(marks) if known is None or name not in known.targets}
    seen = _with_touches(new_rows(cell, known, kept), own_tip, marks, sigma_m, False)
    what = f"{len(seen)} touches of {', '.join(dict.fromkeys(marks))} by {own_tip}, {how}"
    return Imported(str(file), what, seen, entry, by="sample", advice=advice)


def _with_touches(
    rows: Sequence[Row], tip: str, names: Sequence[str], sigma_m: float | None, is_tip_to_tip: bool
) -> tuple[Row, ...]:
    """Rows of which each is a touch of what is named."""
    return tuple(
        replace(row, observations=(TouchObservation(tip, name, sigma_m, is_tip_to_tip),))
        for row, name in zip(rows, names, strict=True)
    )
