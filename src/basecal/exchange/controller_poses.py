"""Reading of flange poses in a controller's convention, with the keys that assign each row to a sample."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from basecal.cell import RobotState
from basecal.errors import BasecalError, DatasetError, InputError, list_names
from basecal.exchange.columns import read_table_text
from basecal.exchange.controllers.convention import (
    DEGREE,
    RADIAN,
    AnyConvention,
    MatrixConvention,
)
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.importing.imported import Row
from basecal.exchange.importing.text_table import (
    TextTable,
    count_numbers,
    is_image,
    parse_number,
    parse_time,
    read_text_table,
    rows_of_numbers,
    select_robot,
)
from basecal.exchange.poses import METRES, LengthUnit, is_archive, read_matrices, unit_length_m
from basecal.exchange.tf_echo import transform_rows
from basecal.exchange.yaskawa_job import is_job, job_positions
from basecal.geometry import SE3, Array


class _Unit(NamedTuple):
    """A unit of a column: its size in SI, and the option that selects it."""

    size: float
    option: str


_STAMP = "stamp_s"
_KEYS = {
    "image": (
        *("image", "picture", "file", "filename", "file_name", "img", "bild", "foto", "photo"),
        *("image_name", "image_file", "image name", "image file", "bildname", "bilddatei", "dateiname"),
    ),
    "sample": ("sample",),
    _STAMP: ("stamp", "timestamp", "time", "t"),
}
_POSITION = r"(?:.*[ ._/])?(?:pos|position|trans|translation)"
_ROTATION = r"(?:.*[ ._/])?(?:rot|rotation|orientation|quat|quaternion)"
# Patterns of alternative column names in lower case, by the controller's name. UR's logs number the TCP pose.
_ALIASES = {
    **{axis: rf"t_?{axis}|p{axis}|{_POSITION}[ ._/]*{axis}|actual_tcp_pose_{k}" for k, axis in enumerate("xyz")},
    **{f"r{axis}": rf"{_ROTATION}[ ._/]*r?{axis}|actual_tcp_pose_{k}" for k, axis in enumerate("xyz", start=3)},
    **{f"q{axis}": rf"q_{axis}|{_ROTATION}[ ._/]*q?{axis}" for axis in "xyzw"},
    **{f"q{k}": rf"q{axis}|{_ROTATION}[ ._/]*q?{axis}" for k, axis in enumerate("wxyz", start=1)},
    **{axis: rf"{_ROTATION}[ ._/]*{axis}" for axis in ("a", "b", "c", "w", "p", "r")},
}
_JOINT = re.compile(r"(?:joint|axis|theta|j|q|a|actual_q)[_ ]?\d")
_UNIT = re.compile(r"^(.*?)(?:_|\s*[\[(/]\s*|\s+in\s+)(mm|m|inch|in|deg|rad|°|s|ms|us|µs|ns)[\])]?$")
_LENGTHS: dict[str, _Unit] = {name: _Unit(size, f"--length-unit {name}") for name, size in METRES.items()}
_LENGTHS["in"] = _LENGTHS["inch"]
_ANGLES = {"deg": _Unit(DEGREE, "--deg"), "°": _Unit(DEGREE, "--deg"), "rad": _Unit(RADIAN, "--rad")}
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
_FULL_TURN = 2 * np.pi  # [rad]
_SMALL_TURN = np.pi  # [deg]: in a calibration some angle always exceeds it
_SHORT_MATRIX = 12  # numbers of a matrix without its last row
_ROW = 4  # numbers of a row of a matrix
_VECTOR_LENGTHS = 6, 7  # numbers of a position with three angles, and with a quaternion
_LONGEST_ARM_M = 20.0  # larger than any flange position in metres, smaller than any in millimetres
_FEWEST_JOINTS = 4  # columns with names of joints
_FEW_ROWS = 0.3  # share of rows: up to it single rows are wrong, above it the unit
_FEWEST_POSES = 3  # poses with small angles needed to conclude a wrong unit


@dataclass(frozen=True)
class PoseFormat:
    """Format of a file of poses: a controller's convention and the units.

    Attributes:
        name: Name of the controller.
        length_m: Unit of length in the file [m]; the controller's unit if None.
        angle_rad: Unit of angle in the file [rad]; the controller's unit if None.
    """

    name: str
    length_m: float | None = None
    angle_rad: float | None = None

    @property
    def convention(self) -> AnyConvention:
        """The controller's convention in the file's units.

        Raises:
            InputError: if a unit of angle is stated and the controller writes no angles.
        """
        convention = CONTROLLERS[self.name]
        if self.length_m is not None:
            convention = replace(convention, length=self.length_m)
        if self.angle_rad is None:
            return convention
        if not convention.has_angles:
            raise InputError(f"{self.name} writes no angles: remove --deg and --rad")
        return replace(convention, angle=self.angle_rad)

    @property
    def words(self) -> str:
        """The convention in words, with its units."""
        convention = self.convention
        length = {size: name for name, size in METRES.items()}[convention.length]
        if isinstance(convention, MatrixConvention):
            return f"4x4 by {'columns' if convention.is_by_columns else 'rows'}, {length}"
        angle = {DEGREE: " in deg", RADIAN: " in rad"}[convention.angle] if convention.has_angles else ""
        return f"{', '.join(convention.names)}: {length}, {convention.form.words}{angle}"


@dataclass(frozen=True, eq=False)
class PoseStream:
    """Poses of one file, in the order of the file.

    Attributes:
        path: Path of the file.
        poses: (n,) transforms, lengths in metres.
        stamps_s: (n,) time stamps [s]; None if the file has none.
    """

    path: str
    poses: SE3
    stamps_s: Array | None = None


class PoseRows(NamedTuple):
    """Poses of a file, (n,), and one row per pose with the keys that assign it to a sample."""

    poses: SE3
    rows: tuple[Row, ...]


def read_controller_poses(
    path: str, robot: str, pose_format: PoseFormat, is_stream: bool = False, is_inverted: bool = False
) -> tuple[Row, ...]:
    """Read rows with the poses of a robot.

    Args:
        path: Table with or without a header and with any usual separator, or a controller's program.
        robot: Name of the robot.
        pose_format: The convention and the units.
        is_stream: Whether every row has a time stamp; it is the first column if there is no header.
        is_inverted: Whether the file holds poses of the base in the flange's frame.

    Raises:
        DatasetError: with file and line, if the content is invalid or the angles are in the wrong unit.
    """
    found = read_pose_rows(path, pose_format, is_stream, robot)
    poses = found.poses.inverse() if is_inverted else found.poses
    return tuple(replace(row, robots={robot: RobotState(poses[i])}) for i, row in enumerate(found.rows))


def read_pose_rows(path: str, pose_format: PoseFormat, is_stream: bool = False, robot: str | None = None) -> PoseRows:
    """Read the poses of a file; see `read_controller_poses`. Without a robot's name, poses of all robots are read."""
    found = _pose_rows(path, pose_format, is_stream, robot)
    if is_stream and any(row.stamp_s is None for row in found.rows):
        raise DatasetError(path, "rows of a stream need times: add a column stamp_s [s], without a header the first")
    return found


def read_poses(path: str | Path, length_unit: LengthUnit) -> PoseStream:
    """Read poses and time stamps of a file whose format can be guessed; other keys of rows are ignored."""
    name = str(path)
    pose_format = PoseFormat(guessed_format(name) or "ros", unit_length_m(length_unit))
    poses, rows = read_pose_rows(name, pose_format)
    stamps_s = [row.stamp_s for row in rows if row.stamp_s is not None]
    return PoseStream(name, poses, np.array(stamps_s) if stamps_s else None)


def _pose_rows(path: str, pose_format: PoseFormat, is_stream: bool, robot: str | None) -> PoseRows:
    convention = pose_format.convention
    if pose_format.name == "matrix" and _is_stacked(path):
        poses = read_matrices(path)
        return PoseRows(SE3(poses.rotation, poses.translation * convention.length), (Row(),) * len(poses))
    names = (_STAMP, *convention.names) if is_stream else convention.names
    table = read_text_table(_table_text(path, pose_format), path, names)
    table = table if robot is None else select_robot(table, robot)
    is_short = (
        pose_format.name == "matrix" and table.header is not None and "m30" not in map(plain_column, table.header)
    )
    columns = _columns(table, convention.names[:_SHORT_MATRIX] if is_short else convention.names, pose_format)
    numbers = np.array(list(rows_of_numbers(table, columns)))
    if is_short:
        numbers = np.concatenate([numbers, np.tile([0.0, 0.0, 0.0, 1.0], (len(numbers), 1))], axis=1)
    _check_angles(path, numbers, [row.line for row in table.rows], convention, pose_format)
    found = []
    for row, values in zip(table.rows, numbers, strict=True):
        try:
            found.append(convention.read(values))
        except BasecalError as error:
            raise DatasetError(table.path, str(error), row.line) from None
    return PoseRows(SE3.stack(found), tuple(keyed_rows(table)))


def _table_text(path: str, pose_format: PoseFormat) -> str:
    """Text of the rows of a table, of a Yaskawa job's positions, or of the output of `tf2_echo`."""
    text = read_table_text(path, "a table of poses")
    if pose_format.name == "ros" and (echoed := transform_rows(text)):
        return echoed
    if text.lstrip().upper().startswith("/PROG"):
        raise DatasetError(path, "a FANUC program is not read: write its positions as a table of X, Y, Z, W, P, R")
    if not is_job(text):
        return text
    if pose_format.name != "yaskawa":
        raise DatasetError(path, f"is a job of a Yaskawa, not a file of {pose_format.name}: give --format yaskawa")
    return job_positions(text, path)


def _is_stacked(path: str) -> bool:
    """Whether a file is an archive, or has each matrix on four lines."""
    if is_archive(path):
        return True
    lines = (line.split("#")[0].replace(",", " ").split() for line in read_table_text(path, "matrices").splitlines())
    return len(next(filter(None, lines), [])) == _ROW


def guessed_format(path: str) -> str:
    """Guess a file's format: `matrix`, `ros` for a header with quaternions, or empty if unknown."""
    if is_archive(path):
        return "matrix"
    lines = read_table_text(path, "a table of poses").splitlines()
    if not path.lower().endswith((".csv", ".xlsx")) and not _is_vector(lines):
        return "matrix"
    first = next(iter(lines), "")
    names = {plain_column(cell.strip("# \"'")).replace("_", "") for cell in re.split("[,;\t]", first)}
    return "matrix" if "m00" in names else "ros" if {"qx", "qy", "qz", "qw"} <= names else ""


def _is_vector(lines: Sequence[str]) -> bool:
    """Whether the first row has as many numbers as a position with angles or a quaternion."""
    return next((count for count in map(count_numbers, lines) if count >= _ROW), 0) in _VECTOR_LENGTHS


def _columns(table: TextTable, names: Sequence[str], pose_format: PoseFormat) -> list[str]:
    """Names of the columns with the numbers of a convention, in the convention's order."""
    if table.header is None:
        first = {name.lower(): name for name in table.rows[0].cells}
        return [first.get(name.lower(), name) for name in names]
    by_name: dict[str, list[str]] = {}
    for column in table.header:
        by_name.setdefault(plain_column(column), []).append(column)
    found = []
    for name in map(str.lower, names):
        matches = [name] if name in by_name else [n for n in by_name if re.fullmatch(_ALIASES.get(name, name), n)]
        chosen = [column for each in matches for column in by_name[each]]
        if len(chosen) > 1:
            raise DatasetError(table.path, f"names the column {name!r} twice: {list_names(chosen)}")
        if not chosen:
            what = (
                f"has no column {name!r} but {list_names(table.header)}; {pose_format.name} writes {', '.join(names)}"
            )
            raise DatasetError(table.path, what + _column_hint(set(by_name)))
        found += chosen
    _check_units(table.path, found, pose_format)
    return found


def _column_hint(columns: set[str]) -> str:
    """Advice on unexpected columns, as the end of a sentence: the matching import, or a renaming."""
    formats = [name for name, each in CONTROLLERS.items() if {column.lower() for column in each.names} <= columns]
    if formats:
        return f"; these columns suit --format {list_names(formats)}"
    are_joints = sum(bool(_JOINT.match(column)) for column in columns) >= _FEWEST_JOINTS
    if are_joints:
        return "; these look like joints: record poses, or use basecal import joints"
    is_ascii = all(column.isascii() for column in columns)
    return ": use these names in the header" + ("" if is_ascii else ", and save the file in UTF-8")


def plain_column(column: str) -> str:
    """A column's name in lower case without its unit."""
    return (_UNIT.sub(r"\1", column.strip().lower())).strip()


def column_unit(column: str) -> tuple[str, float] | None:
    """Unit of length in a column's name, and its size [m]; None if the name has no such unit."""
    found = _UNIT.match(column.strip().lower())
    unit = None if found is None else _LENGTHS.get(found[2])
    return None if found is None or unit is None else (found[2], unit.size)


def _check_units(path: str, columns: Sequence[str], pose_format: PoseFormat) -> None:
    """Check that units in the names of columns agree with the units in which they are read."""
    for index, column in enumerate(columns):
        unit = _UNIT.match(column.strip().lower())
        if unit is None:
            continue
        units, used = _possible_units(index, pose_format.convention)
        if unit[2] not in units:
            expected = f"expected {list_names(tuple(units))}" if units else "expected no unit"
            raise DatasetError(path, f"the unit is {unit[2]}, {expected}", field=column)
        if units[unit[2]].size != used:
            option = units[unit[2]].option
            raise DatasetError(path, f"the unit is {unit[2]}, but another is expected: give {option}", field=column)


def _possible_units(index: int, convention: AnyConvention) -> tuple[Mapping[str, _Unit], float]:
    """Units allowed for a number of a convention, and the size of the unit in use; empty for unitless numbers."""
    if isinstance(convention, MatrixConvention):
        row, column = divmod(index, 4)
        is_length = (row if convention.is_by_columns else column) == 3 and index < len(convention.names) - 1
        return (_LENGTHS if is_length else {}), convention.length
    if index < 3:
        return _LENGTHS, convention.length
    return _ANGLES if convention.has_angles else {}, convention.angle


def _check_angles(
    path: str, numbers: Array, lines: Sequence[int], convention: AnyConvention, pose_format: PoseFormat
) -> None:
    """Check that angles are not degrees read as radians, or radians read as degrees."""
    if not convention.has_angles:
        return
    angles = numbers[:, 3:]
    if other := _other_controllers(numbers, convention, pose_format):
        raise DatasetError(path, f"these numbers are not in the units of {pose_format.name}. {other}")
    if convention.angle == RADIAN and np.abs(angles).max() > _FULL_TURN:
        odd = np.flatnonzero(np.abs(angles).max(axis=1) > _FULL_TURN).tolist()
        if len(odd) > _FEW_ROWS * len(angles):
            raise DatasetError(path, f"angles up to {np.abs(angles).max():.4g} are not radians: give --deg")
        value, odd_lines = np.abs(angles[odd[0]]).max(), list_names([str(lines[k]) for k in odd])
        raise DatasetError(
            path, f"{value:.4g} is not an angle in radians: correct line {odd_lines}, or give --deg", lines[odd[0]]
        )
    # The length of a rotation vector is the angle; all angles about axes are small only if nothing rotates.
    is_small = (
        len(numbers) >= _FEWEST_POSES and np.abs(angles).max() <= _SMALL_TURN and np.ptp(angles, axis=0).max() > 0
    )
    if convention.angle == DEGREE and is_small and pose_format.angle_rad is None:
        raise DatasetError(
            path,
            f"the angles of {len(numbers)} poses reach only {np.abs(angles).max():.3g}: they look like radians. "
            "Give --rad, or --deg if they are degrees",
        )


def _other_controllers(numbers: Array, convention: AnyConvention, pose_format: PoseFormat) -> str:
    """Advice if lengths and angles are both in the units of other controllers; empty if they need not be."""
    if pose_format.length_m is not None or pose_format.angle_rad is not None or len(numbers) < _FEWEST_POSES:
        return ""
    length, angle = (float(np.abs(part).max()) for part in (numbers[:, :3], numbers[:, 3:]))
    units = (METRES["mm"], DEGREE) if length > _LONGEST_ARM_M else (METRES["m"], RADIAN)
    fits = angle > _FULL_TURN if units[1] == DEGREE else 0 < angle <= _SMALL_TURN
    if not fits or convention.length == units[0] or convention.angle == units[1]:
        return ""
    names = [name for name, each in CONTROLLERS.items() if each.has_angles and (each.length, each.angle) == units]
    words, options = (
        ("millimetres and degrees", "mm --deg") if units[1] == DEGREE else ("metres and radians", "m --rad")
    )
    return f"They look like {words}: give --length-unit {options}, or --format {list_names(names)}"


def keyed_rows(table: TextTable) -> list[Row]:
    """Convert a table to rows with the keys of its columns `image`, `sample` and `stamp_s`, or a time with its unit.

    Raises:
        DatasetError: if a sample is not a whole number, or a time is not a number.
    """
    units = {column: _UNIT.match(column.strip().lower()) for column in table.columns}
    columns = {plain_column(column): column for column, unit in units.items() if unit is None or unit[2] in _SECONDS}
    image, sample, stamp = (next((columns[n] for n in names if n in columns), None) for names in _KEYS.values())
    if image is None:
        image = next(
            (name for name in table.columns if all(is_image(row.cells.get(name, "")) for row in table.rows)), None
        )
    unit = units.get(stamp or "")
    unit_s = 1.0 if unit is None else _SECONDS[unit[2]]
    rows = []
    for row in table.rows:
        name = None if image is None else row.cells.get(image, "").strip("\"' ")
        number = None if sample is None else parse_number(table.cell(row, sample), table.path, row.line, sample)
        if sample is not None and number is not None and (number != int(number) or number < 0):
            raise DatasetError(table.path, f"{table.cell(row, sample)} is not a whole number from 0", row.line, sample)
        stamp_s = None if stamp is None else parse_time(table.cell(row, stamp), table.path, row.line, stamp, unit_s)
        sample_number = None if number is None else int(number)
        rows.append(Row(image=name, sample=sample_number, stamp_s=stamp_s, line=row.line))
    return rows
