"""Reading of joint values in the order of a chain, with the keys that assign each row to a sample."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import chain as joined
from pathlib import Path
from typing import Any

import numpy as np

from basecal.cell import RobotState
from basecal.errors import DatasetError, InputError, UsageError, count_text, list_names
from basecal.exchange.columns import read_table_text
from basecal.exchange.controller_poses import keyed_rows
from basecal.exchange.importing.imported import Row, known_cell
from basecal.exchange.importing.text_table import TextTable, read_text_table, rows_of_numbers, select_robot
from basecal.geometry import Array
from basecal.kinematics import SerialChain, read_chain
from basecal.kinematics.chain import LIMIT_EXCESS_RAD

_UNLIMITED_RAD = 2.2 * math.pi  # largest angle of a joint without limits: a bit more than one revolution
_FEWEST_ROWS = 3  # rows with small angles needed to conclude a wrong unit
_DEGREE = math.radians(1)
# How controllers number joints: j1, q1, a1 (KUKA), joint_1, theta1; from 0 or from 1.
_NUMBERED = re.compile(r"(joint|axis|theta|j|q|a)[_ ]?(\d+)(?:[_. ]?pos)?", re.IGNORECASE)
_UNIT = re.compile(r"[\s\[(_.]+(deg|rad|°)[\])]?$", re.IGNORECASE)
_WIDEST_DEG = 45.0  # largest sigma of a joint offset: a larger one is no information


def read_joints(path: str, robot: str, chain: SerialChain, in_degrees: bool) -> tuple[Row, ...]:
    """Read rows with the joints of a robot [rad].

    Args:
        path: Table with any usual separator; its header names the chain's joints or numbers them (j1, q1, A1), or is
            missing.
        robot: Name of the robot.
        chain: Kinematics of the robot.
        in_degrees: Whether values are in degrees; if False, in radians.

    Raises:
        DatasetError: with file and line, if the content is invalid, columns are ambiguous or in another unit, or a
            joint exceeds its limits. It is also raised if values stated in degrees look like radians.
    """
    text = read_table_text(path, "a table of joints")
    table = select_robot(read_text_table(text, path, chain.joint_names), robot)
    values = np.array(list(rows_of_numbers(table, _columns(table, chain, in_degrees))))
    joints = values * _DEGREE if in_degrees else values
    _check_limits(table, values, joints, chain, in_degrees)
    return tuple(
        replace(row, robots={robot: RobotState(joints_rad=joints[i])}) for i, row in enumerate(keyed_rows(table))
    )


def _columns(table: TextTable, chain: SerialChain, in_degrees: bool) -> list[str]:
    """Names of the columns of the chain's joints, in the chain's order."""
    names, path = chain.joint_names, table.path
    if table.header is None:
        return list(names)
    found = _find_columns(table.header, names)
    if not found:
        present = list_names(table.header)
        expected = f"expected {', '.join(names)}, or {len(names)} numbered ones such as j1, q1 or A1"
        raise DatasetError(path, f"has columns {present}; {expected}")
    for name, columns in zip(names, found, strict=True):
        if len(columns) > 1:
            raise DatasetError(path, f"names the joint {name!r} twice, {list_names(columns)}: keep one")
        unit = None if columns[0] == name else _UNIT.search(columns[0])
        if unit is not None and (unit[1].lower() != "rad") != in_degrees:
            do = "remove --deg" if in_degrees else "give --deg"
            raise DatasetError(path, f"the unit is {unit[1]}, but another is expected: {do}", field=columns[0])
    return [columns[0] for columns in found]


def _find_columns(header: Sequence[str], names: Sequence[str]) -> list[list[str]]:
    """Columns of each joint, by the first way of naming that has all joints; empty if none has."""
    plain = {column: _UNIT.sub("", column.strip()) for column in header}
    # LeRobot and others write `shoulder_pan.pos`.
    stems = {column: name.rpartition(".")[0] or name for column, name in plain.items()}
    for naming in ({column: column for column in header}, plain, stems):
        found = [[column for column in header if naming[column] == name] for name in names]
        if all(found):
            return found
    families: dict[str, dict[int, list[str]]] = {}
    for column in header:
        if numbered := _NUMBERED.fullmatch(plain[column]):
            families.setdefault(numbered[1].lower(), {}).setdefault(int(numbered[2]), []).append(column)
    whole = [[family[k] for k in sorted(family)] for family in families.values() if len(family) == len(names)]
    return [[*joined.from_iterable(columns)] for columns in zip(*whole, strict=True)]


def radians_finding(values: Array) -> str:
    """Message if joints (n, joints) stated in degrees look like radians; empty if they do not."""
    most = np.abs(values).max(initial=0.0)
    if len(values) < _FEWEST_ROWS or most > math.pi or np.ptp(values, axis=0).max() == 0:
        return ""
    return f"no joint of {count_text(len(values), 'row')} is beyond {most:.3g} degrees, so they look like radians"


def _check_limits(table: TextTable, values: Array, joints: Array, chain: SerialChain, in_degrees: bool) -> None:
    """Check that every joint is within its limits with a margin, or within 2.2 pi without limits."""
    lower = np.where(np.isfinite(chain.lower), chain.lower - LIMIT_EXCESS_RAD, -_UNLIMITED_RAD)
    upper = np.where(np.isfinite(chain.upper), chain.upper + LIMIT_EXCESS_RAD, _UNLIMITED_RAD)
    if in_degrees and (finding := radians_finding(values)):
        raise DatasetError(table.path, f"{finding}: remove --deg")
    outside = (joints < lower) | (joints > upper)
    if not outside.any():
        return
    row, joint = np.argwhere(outside)[0]
    line, name = table.rows[row].line, chain.joint_names[joint]
    angle = f"{joints[row, joint]:.4g} rad, {_limit_text(chain, joint)}"
    radians, backwards = values * _DEGREE, joints[:, ::-1]
    if not in_degrees and np.abs(values).max() > _UNLIMITED_RAD and ((radians >= lower) & (radians <= upper)).all():
        hint = "give --deg, they look like degrees"
    elif ((backwards >= lower) & (backwards <= upper)).all():  # the usual error of the order
        hint = f"the columns may be in another order, such as {', '.join(reversed(chain.joint_names))}"
    else:
        hint = "check the order of the joints, and that the URDF is this robot's"
    raise DatasetError(table.path, f"is at {angle}: {hint}", line, name)


def _limit_text(chain: SerialChain, joint: int) -> str:
    lower, upper = chain.lower[joint], chain.upper[joint]
    if np.isfinite(lower) and np.isfinite(upper):
        return f"its limits are {lower:.4g} to {upper:.4g}"
    return f"without limits it may turn by {_UNLIMITED_RAD:.4g} either way"


@dataclass(frozen=True, eq=False)
class JointModel:
    """The kinematics of a robot whose joints are imported.

    Attributes:
        chain: Chain from the base to the flange.
        entry: Entries to add to `cell.yaml`.
        files: Files to copy into the cell, by their path in it.
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
    """Kinematics of a robot from the cell, or from a URDF imported with the joints.

    Args:
        folder: Folder of the cell, or of a new cell.
        robot: Name of the robot.
        urdf: The robot's URDF, if the cell has none.
        base_link: Base link of the robot in that URDF.
        flange_link: Flange link of the robot in that URDF.
        offset_sigma_deg: Prior sigma of each joint's offset [deg]; no prior if None.

    Raises:
        UsageError: if only some of URDF and links are given, or the sigma is out of range.
        InputError: if neither the arguments nor the cell have a URDF.
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
        chain = cell.robots[robot].chain if robot in cell.robots else None
        if chain is None:
            give = "give --urdf FILE --base-link LINK --flange-link LINK"
            raise InputError(f"{folder} has no URDF of {robot!r}, which joints need: {give}")
        return JointModel(chain, {"robots": {robot: prior}} if prior else {})
    name = Path(urdf).name
    entry = {"urdf": name, "base_link": base_link, "flange_link": flange_link, **prior}
    return JointModel(read_chain(urdf, base_link, flange_link), {"robots": {robot: entry}}, {name: Path(urdf)})
