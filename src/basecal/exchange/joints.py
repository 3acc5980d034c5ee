"""Joints of a file, in the order of a chain, row by row with what says where each belongs."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from basecal.cell import RobotState
from basecal.errors import DatasetError, InputError, UsageError
from basecal.exchange.columns import read_table_text
from basecal.exchange.controller_poses import keyed_rows
from basecal.exchange.importing.imported import Row, known_cell
from basecal.exchange.importing.text_table import TextTable, read_text_table, rows_of_numbers, select_robot
from basecal.geometry import Array
from basecal.kinematics import SerialChain, read_chain
from basecal.kinematics.chain import LIMIT_EXCESS_RAD

_UNLIMITED_RAD = 2.2 * math.pi  # of a joint without limits: a turn and a bit
_FEWEST_ROWS = 3  # rows in which nothing moves beyond some degrees, before that is taken for a unit
_DEGREE = math.radians(1)
# How controllers number joints: j1, q1, a1 (KUKA), joint_1, theta1; from 0 or from 1.
_NUMBERED = re.compile(r"(?:joint|axis|theta|j|q|a)[_ ]?(\d+)(?:[_. ]?(?:deg|rad|pos))?", re.IGNORECASE)
_WIDEST_DEG = 45.0  # of a joint's offset: beyond this nothing is known of it


def read_joints(path: str, robot: str, chain: SerialChain, in_degrees: bool) -> tuple[Row, ...]:
    """Rows with the joints of a robot [rad].

    Args:
        path: Text in any usual separator, with a header that names the chain's joints or numbers them (j1, q1, A1), or
            none.
        robot: Its name.
        chain: Its kinematics.
        in_degrees: Whether they are in degrees, not radians.

    Raises:
        DatasetError: naming the file and line, if it holds anything else, or if a joint is beyond its limits. It is
            also raised if values that are stated in degrees look like radians.
    """
    text = read_table_text(path, "a table of joints")
    table = select_robot(read_text_table(text, path, chain.joint_names), robot)
    values = np.array(list(rows_of_numbers(table, _columns(table, chain))))
    joints = values * _DEGREE if in_degrees else values
    _check_limits(table, values, joints, chain, in_degrees)
    return tuple(
        replace(row, robots={robot: RobotState(joints_rad=joints[i])}) for i, row in enumerate(keyed_rows(table))
    )


def _columns(table: TextTable, chain: SerialChain) -> list[str]:
    """The columns of the chain's joints, in its order."""
    names = chain.joint_names
    if table.header is None or all(name in table.header for name in names):
        return list(names)
    # LeRobot and others write `shoulder_pan.pos`.
    by_stem = {column.rpartition(".")[0] or column: column for column in table.header}
    if all(name in by_stem for name in names):
        return [by_stem[name] for name in names]
    numbered = {int(found[1]): column for column in table.header if (found := _NUMBERED.fullmatch(column.strip()))}
    if len(numbered) == len(names):
        return [numbered[number] for number in sorted(numbered)]
    there = ", ".join(table.header)
    expected = f"expected {', '.join(names)}, or {len(names)} numbered ones such as j1, q1 or A1"
    raise DatasetError(table.path, f"has columns {there}; {expected}")


def radians_finding(values: Array) -> str:
    """Finding of joints (n, joints) that are stated in degrees and look like radians; empty if they do not."""
    most = np.abs(values).max(initial=0.0)
    if len(values) < _FEWEST_ROWS or most > math.pi or np.ptp(values, axis=0).max() == 0:
        return ""
    return f"no joint of {len(values)} rows is beyond {most:.3g} degrees, these look like radians"


def _check_limits(table: TextTable, values: Array, joints: Array, chain: SerialChain, in_degrees: bool) -> None:
    """Check that every joint is within its limits, or a turn, by a margin."""
    lower = np.where(np.isfinite(chain.lower), chain.lower - LIMIT_EXCESS_RAD, -_UNLIMITED_RAD)
    upper = np.where(np.isfinite(chain.upper), chain.upper + LIMIT_EXCESS_RAD, _UNLIMITED_RAD)
    if in_degrees and (finding := radians_finding(values)):
        raise DatasetError(table.path, f"{finding}: leave --deg away")
    outside = (joints < lower) | (joints > upper)
    if not outside.any():
        return
    row, joint = np.argwhere(outside)[0]
    line, name = table.rows[row].line, chain.joint_names[joint]
    there = f"{joints[row, joint]:.4g} rad, its limits are {chain.lower[joint]:.4g} to {chain.upper[joint]:.4g}"
    turned, backwards = values * _DEGREE, joints[:, ::-1]
    if not in_degrees and np.abs(values).max() > _UNLIMITED_RAD and ((turned >= lower) & (turned <= upper)).all():
        hint = "give --deg, these are degrees"
    elif ((backwards >= lower) & (backwards <= upper)).all():  # the one slip of order that is usual
        hint = f"the columns may be in another order, such as {', '.join(reversed(chain.joint_names))}"
    else:
        hint = "check the order of the joints, and that the URDF is this robot's"
    raise DatasetError(table.path, f"is at {there}: {hint}", line, name)


@dataclass(frozen=True, eq=False)
class JointModel:
    """The kinematics of a robot whose joints are imported.

    Attributes:
        chain: From its base to its flange.
        entry: What `cell.yaml` must have for it.
        files: Files that go into the cell, by their path there.
    """

    chain: SerialChain
    entry: dict[str, Any]
    files: dict[str, Path] = field(default_factory=dict)


def joint_model(
    folder: str | Path,
    robot: str,
    urdf: str | Path | None,
    base_link: str | None,
    flange_link: str | None,
    offset_sigma_deg: float | None,
) -> JointModel:
    """The kinematics of the cell, or of a URDF that comes with the joints.

    Args:
        folder: The cell, or where one is to be made.
        robot: Its name.
        urdf: Its URDF, if the cell has none.
        base_link: Link of that URDF that the robot stands on.
        flange_link: Link of that URDF that is the flange.
        offset_sigma_deg: Sigma of a prior of each joint's offset [deg]; no prior if None.

    Raises:
        UsageError: if a URDF is given without its links, or links without it, or the sigma is out of range.
        InputError: if none is given, and the cell has none.
    """
    links = (urdf, base_link, flange_link)
    if any(each is not None for each in links) and None in links:
        raise UsageError("--urdf, --base-link and --flange-link go together: give all three")
    if offset_sigma_deg is not None and not 0 < offset_sigma_deg <= _WIDEST_DEG:
        raise UsageError(f"--offset-sigma-deg {offset_sigma_deg:g}: expected more than 0 and at most {_WIDEST_DEG:g}")
    prior = {}
    if offset_sigma_deg is not None:
        prior = {"joint_offsets": {"status": "prior", "sigma_rad": round(math.radians(offset_sigma_deg), 5)}}
    if urdf is None or base_link is None or flange_link is None:
        cell = known_cell(folder)
        known = cell.robots[robot].chain if robot in cell.robots else None
        if known is None:
            give = "give --urdf FILE --base-link LINK --flange-link LINK"
            raise InputError(f"{folder} has no URDF of {robot!r}, which joints need: {give}")
        return JointModel(known, {"robots": {robot: prior}} if prior else {})
    name = Path(urdf).name
    described = {"urdf": name, "base_link": base_link, "flange_link": flange_link, **prior}
    return JointModel(read_chain(urdf, base_link, flange_link), {"robots": {robot: described}}, {name: Path(urdf)})
