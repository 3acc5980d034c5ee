"""Flange poses of a file in a controller's convention, row by row with what says where each belongs."""

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
    """A unit that a column may name: its size in SI, and the option that has the column read in it."""

    size: float
    option: str


_STAMP = "stamp_s"
_KEYS = {
    "image": (
        *("image", "picture", "file", "filename", "file_name", "img", "bild", "foto", "photo"),
        *("image_name", "image_file", "image name", "image file", "bildname", "bilddatei", "dateiname"),
    ),
    "sample": ("sample",),
    _STAMP: ("stamp_s", "stamp", "timestamp", "time_s", "time", "t"),
}
_PLACE = r"(?:.*[ ._/])?(?:pos|position|trans|translation)"
_TURN = r"(?:.*[ ._/])?(?:rot|rotation|orientation|quat|quaternion)"
# Other names of a number by the one its controller has, in small letters, as patterns. UR's logs number the TCP's pose.
_ALIASES = {
    **{axis: rf"t_?{axis}|p{axis}|{_PLACE}[ ._/]*{axis}|actual_tcp_pose_{k}" for k, axis in enumerate("xyz")},
    **{f"r{axis}": rf"{_TURN}[ ._/]*r?{axis}|actual_tcp_pose_{k}" for k, axis in enumerate("xyz", start=3)},
    **{f"q{axis}": rf"q_{axis}|{_TURN}[ ._/]*q?{axis}" for axis in "xyzw"},
    **{f"q{k}": rf"q{axis}|{_TURN}[ ._/]*q?{axis}" for k, axis in enumerate("wxyz", start=1)},
    **{axis: rf"{_TURN}[ ._/]*{axis}" for axis in ("a", "b", "c", "w", "p", "r")},
}
_JOINT = re.compile(r"(?:joint|axis|theta|j|q|a|actual_q)[_ ]?\d")
_UNIT = re.compile(r"^(.*?)(?:_|\s*[\[(/]\s*|\s+in\s+)(mm|m|inch|in|deg|rad|°)[\])]?$")
_LENGTHS: dict[str, _Unit] = {name: _Unit(size, f"--length-unit {name}") for name, size in METRES.items()}
_LENGTHS["in"] = _LENGTHS["inch"]
_ANGLES = {"deg": _Unit(DEGREE, "--deg"), "°": _Unit(DEGREE, "--deg"), "rad": _Unit(RADIAN, "--rad")}
_FULL_TURN = 2 * np.pi  # [rad]
_SMALL_TURN = np.pi  # degrees up to which angles of arms that calibrate never all stay
_SHORT_MATRIX = 12  # numbers of a matrix without its last row
_ROW = 4  # numbers of a row of a matrix
_VECTOR_LENGTHS = 6, 7  # numbers of a position with three angles, and with a quaternion
_LONGEST_ARM_M = 20.0  # farther than any flange is in metres, and nearer than any is in millimetres
_FEWEST_JOINTS = 4  # columns with names of joints
_FEW_ROWS = 0.3  # share of rows, up to which these are wrong and not the unit of all
_FEWEST_POSES = 3  # poses of which all are turned little, before that is taken for a unit


@dataclass(frozen=True)
class Reading:
    """How a file of poses is to be read.

    Attributes:
        name: Of the controller.
        length_m: A length in the file [m]; the controller's own where None.
        angle_rad: An angle in the file [rad]; likewise.
    """

    name: str
    length_m: float | None = None
    angle_rad: float | None = None

    @property
    def convention(self) -> AnyConvention:
        """The controller's convention in the file's units.

        Raises:
            InputError: if the unit of angles is stated and it writes none.
        """
        own = CONTROLLERS[self.name]
        if self.length_m is not None:
            own = replace(own, length=self.length_m)
        if self.angle_rad is None:
            return own
        if not own.has_angles:
            raise InputError(f"{self.name} writes no angles: leave --deg and --rad away")
        return replace(own, angle=self.angle_rad)

    @property
    def words(self) -> str:
        """The convention in words, with its units."""
        how = self.convention
        length = {size: name for name, size in METRES.items()}[how.length]
        if isinstance(how, MatrixConvention):
            return f"4x4 by {'columns' if how.is_by_columns else 'rows'}, {length}"
        angle = {DEGREE: " in deg", RADIAN: " in rad"}[how.angle] if how.has_angles else ""
        return f"{', '.join(how.names)}: {length}, {how.form.words}{angle}"


@dataclass(frozen=True, eq=False)
class PoseStream:
    """Poses from one file, in its order.

    Attributes:
        path: Where they were read.
        poses: (n,) transforms, lengths in metres.
        stamps_s: (n,) times; None if the file has none.
    """

    path: str
    poses: SE3
    stamps_s: Array | None = None


class PoseRows(NamedTuple):
    """Poses of a file, (n,), and for each a row with what says where it belongs."""

    poses: SE3
    rows: tuple[Row, ...]


def read_controller_poses(
    path: str, robot: str, reading: Reading, is_stream: bool = False, is_inverted: bool = False
) -> tuple[Row, ...]:
    """Rows with the pose of a robot.

    Args:
        path: Text: with or without a header, in any usual separator, or as a controller's program has poses.
        robot: Its name.
        reading: The convention and the units.
        is_stream: Whether every row has a time, the first column where there is no header.
        is_inverted: Whether they are those of the base in the flange.

    Raises:
        DatasetError: naming the file and line, if it holds anything else; also where angles are in the other unit.
    """
    found = read_pose_rows(path, reading, is_stream, robot)
    poses = found.poses.inverse() if is_inverted else found.poses
    return tuple(replace(row, robots={robot: RobotState(poses[i])}) for i, row in enumerate(found.rows))


def read_pose_rows(path: str, reading: Reading, is_stream: bool = False, robot: str | None = None) -> PoseRows:
    """Poses of a file, likewise; whosever they are if no robot is named."""
    found = _pose_rows(path, reading, is_stream, robot)
    if is_stream and any(row.stamp_s is None for row in found.rows):
        raise DatasetError(path, "no time in its rows, which a stream takes: a column stamp_s [s], the first of all")
    return found


def read_poses(path: str | Path, length_unit: LengthUnit) -> PoseStream:
    """Poses of a file that says alone how they are written, without what says where they belong but their times."""
    name = str(path)
    reading = Reading(guessed_format(name) or "ros", unit_length_m(length_unit))
    poses, rows = read_pose_rows(name, reading)
    stamps_s = [row.stamp_s for row in rows if row.stamp_s is not None]
    return PoseStream(name, poses, np.array(stamps_s) if stamps_s else None)


def _pose_rows(path: str, reading: Reading, is_stream: bool, robot: str | None) -> PoseRows:
    how = reading.convention
    if reading.name == "matrix" and _is_stacked(path):
        poses = read_matrices(path)
        return PoseRows(SE3(poses.rotation, poses.translation * how.length), (Row(),) * len(poses))
    names = (_STAMP, *how.names) if is_stream else how.names
    table = read_text_table(_table_text(path, reading), path, names)
    table = table if robot is None else select_robot(table, robot)
    is_short = reading.name == "matrix" and table.header is not None and "m30" not in map(plain_column, table.header)
    columns = _columns(table, how.names[:_SHORT_MATRIX] if is_short else how.names, reading)
    numbers = np.array(list(rows_of_numbers(table, columns)))
    if is_short:
        numbers = np.concatenate([numbers, np.tile([0.0, 0.0, 0.0, 1.0], (len(numbers), 1))], axis=1)
    _check_angles(path, numbers, [row.line for row in table.rows], how, reading)
    found = []
    for row, values in zip(table.rows, numbers, strict=True):
        try:
            found.append(how.read(values))
        except BasecalError as error:
            raise DatasetError(table.path, str(error), row.line) from None
    return PoseRows(SE3.stack(found), tuple(keyed_rows(table)))


def _table_text(path: str, reading: Reading) -> str:
    """The rows of a table, of the positions of a Yaskawa job, or of what `tf2_echo` printed."""
    text = read_table_text(path, "a table of poses")
    if reading.name == "ros" and (echoed := transform_rows(text)):
        return echoed
    if text.lstrip().upper().startswith("/PROG"):
        raise DatasetError(path, "a FANUC program is not read: write its positions as a table of X, Y, Z, W, P, R")
    if not is_job(text):
        return text
    if reading.name != "yaskawa":
        raise DatasetError(path, f"a job of a Yaskawa, read as of {reading.name}: give --format yaskawa")
    return job_positions(text, path)


def _is_stacked(path: str) -> bool:
    """Whether a file is an archive, or has the four rows of a matrix one below the other."""
    if is_archive(path):
        return True
    lines = (line.split("#")[0].replace(",", " ").split() for line in read_table_text(path, "matrices").splitlines())
    return len(next(filter(None, lines), [])) == _ROW


def guessed_format(path: str) -> str:
    """The format of a file that says it alone: of matrices, or of a header with quaternions as of ROS; else empty."""
    if is_archive(path):
        return "matrix"
    lines = read_table_text(path, "a table of poses").splitlines()
    if not path.lower().endswith((".csv", ".xlsx")) and not _is_vector(lines):
        return "matrix"
    first = next(iter(lines), "")
    names = {plain_column(cell.strip("# \"'")).replace("_", "") for cell in re.split("[,;\t]", first)}
    return "matrix" if "m00" in names else "ros" if {"qx", "qy", "qz", "qw"} <= names else ""


def _is_vector(lines: Sequence[str]) -> bool:
    """Whether the first row of a text is as long as a position with angles or a quaternion."""
    return next((count for count in map(count_numbers, lines) if count >= _ROW), 0) in _VECTOR_LENGTHS


def _columns(table: TextTable, names: Sequence[str], reading: Reading) -> list[str]:
    """The columns that hold the numbers of a convention, in its order."""
    if table.header is None:
        first = {name.lower(): name for name in table.rows[0].cells}
        return [first.get(name.lower(), name) for name in names]
    by_name: dict[str, list[str]] = {}
    for column in table.header:
        by_name.setdefault(plain_column(column), []).append(column)
    found = []
    for name in map(str.lower, names):
        alike = [name] if name in by_name else [n for n in by_name if re.fullmatch(_ALIASES.get(name, name), n)]
        chosen = [column for each in alike for column in by_name[each]]
        if len(chosen) > 1:
            raise DatasetError(table.path, f"names the column {name!r} twice: {list_names(chosen)}")
        if not chosen:
            what = f"has no column {name!r} but {', '.join(table.header)}; {reading.name} writes {', '.join(names)}"
            raise DatasetError(table.path, what + _column_hint(set(by_name)))
        found += chosen
    _check_units(table.path, found, reading)
    return found


def _column_hint(columns: set[str]) -> str:
    """Advice on other columns, as the end of a sentence: the import that they suit, or other names."""
    formats = [name for name, each in CONTROLLERS.items() if {column.lower() for column in each.names} <= columns]
    if formats:
        return f"; these columns suit --format {list_names(formats)}"
    are_joints = sum(bool(_JOINT.match(column)) for column in columns) >= _FEWEST_JOINTS
    if are_joints:
        return "; these look like joints: record poses, or use basecal import joints"
    is_ascii = all(column.isascii() for column in columns)
    return ": name them so in the header" + ("" if is_ascii else ", and save the file in UTF-8")


def plain_column(column: str) -> str:
    """A column's name in small letters without its unit."""
    return (_UNIT.sub(r"\1", column.strip().lower())).strip()


def column_unit(column: str) -> tuple[str, float] | None:
    """The unit of length that a column names, and its size [m]; None if it names none."""
    found = _UNIT.match(column.strip().lower())
    unit = None if found is None else _LENGTHS.get(found[2])
    return None if found is None or unit is None else (found[2], unit.size)


def _check_units(path: str, columns: Sequence[str], reading: Reading) -> None:
    """A unit that a column names must be the one it is read in."""
    for place, column in enumerate(columns):
        unit = _UNIT.match(column.strip().lower())
        if unit is None:
            continue
        units, used = _possible_units(place, reading.convention)
        if unit[2] not in units:
            expected = f"expected {list_names(tuple(units))}" if units else "expected no unit"
            raise DatasetError(path, f"the column says {unit[2]}, {expected}", field=column)
        if units[unit[2]].size != used:
            option = units[unit[2]].option
            raise DatasetError(
                path, f"the column says {unit[2]}, and it is read otherwise: give {option}", field=column
            )


def _possible_units(place: int, convention: AnyConvention) -> tuple[Mapping[str, _Unit], float]:
    """The units that a number of a convention may have, and the one it is read in; none of numbers without unit."""
    if isinstance(convention, MatrixConvention):
        row, column = divmod(place, 4)
        is_length = (row if convention.is_by_columns else column) == 3 and place < len(convention.names) - 1
        return (_LENGTHS if is_length else {}), convention.length
    if place < 3:
        return _LENGTHS, convention.length
    return _ANGLES if convention.has_angles else {}, convention.angle


def _check_angles(path: str, numbers: Array, lines: Sequence[int], convention: AnyConvention, reading: Reading) -> None:
    """Degrees taken for radians, and radians taken for degrees, where no other reading can be."""
    if not convention.has_angles:
        return
    angles = numbers[:, 3:]
    if other := _other_controllers(numbers, convention, reading):
        raise DatasetError(path, f"these numbers are not in the units of {reading.name}. {other}")
    if convention.angle == RADIAN and np.abs(angles).max() > _FULL_TURN:
        odd = np.flatnonzero(np.abs(angles).max(axis=1) > _FULL_TURN).tolist()
        if len(odd) > _FEW_ROWS * len(angles):
            raise DatasetError(path, f"angles up to {np.abs(angles).max():.4g} are no radians: give --deg")
        value, where = np.abs(angles[odd[0]]).max(), list_names([str(lines[k]) for k in odd])
        raise DatasetError(
            path, f"{value:.4g} is no angle in radians: correct line {where}, or give --deg", lines[odd[0]]
        )
    # A rotation vector is as long as the turn; angles about axes may all be small only where nothing turns.
    is_small = (
        len(numbers) >= _FEWEST_POSES and np.abs(angles).max() <= _SMALL_TURN and np.ptp(angles, axis=0).max() > 0
    )
    if convention.angle == DEGREE and is_small and reading.angle_rad is None:
        raise DatasetError(
            path,
            f"no angle of {len(numbers)} poses is beyond {np.abs(angles).max():.3g}: these look like radians, "
            "give --rad, or --deg where they are degrees",
        )


def _other_controllers(numbers: Array, convention: AnyConvention, reading: Reading) -> str:
    """Finding of lengths and angles that are both in the units of other controllers; nothing if they need not be."""
    if reading.length_m is not None or reading.angle_rad is not None or len(numbers) < _FEWEST_POSES:
        return ""
    length, angle = (float(np.abs(part).max()) for part in (numbers[:, :3], numbers[:, 3:]))
    units = (METRES["mm"], DEGREE) if length > _LONGEST_ARM_M else (METRES["m"], RADIAN)
    fits = angle > _FULL_TURN if units[1] == DEGREE else 0 < angle <= _SMALL_TURN
    if (
        not fits
        or units == (convention.length, convention.angle)
        or convention.length == units[0]
        or convention.angle == units[1]
    ):
        return ""
    names = [name for name, each in CONTROLLERS.items() if each.has_angles and (each.length, each.angle) == units]
    words, options = (
        ("millimetres and degrees", "mm --deg") if units[1] == DEGREE else ("metres and radians", "m --rad")
    )
    return f"They look like {words}: give --length-unit {options}, or --format {list_names(names)}"


def keyed_rows(table: TextTable) -> list[Row]:
    """A row for each of a table, with what says where it belongs: its columns `image`, `sample` and `stamp_s`.

    Raises:
        DatasetError: if a sample is no whole number, or a time no number.
    """
    there = {plain_column(column): column for column in table.rows[0].cells}
    image, sample, stamp = (next((there[n] for n in names if n in there), None) for names in _KEYS.values())
    if image is None:
        cells = table.rows[0].cells
        image = next((name for name in cells if all(is_image(row.cells.get(name, "")) for row in table.rows)), None)
    rows = []
    for row in table.rows:
        name = None if image is None else row.cells[image].strip("\"' ")
        number = None if sample is None else parse_number(table.cell(row, sample), table.path, row.line, sample)
        if sample is not None and number is not None and (number != int(number) or number < 0):
            raise DatasetError(table.path, f"{table.cell(row, sample)} is not a whole number from 0", row.line, sample)
        stamp_s = None if stamp is None else parse_time(table.cell(row, stamp), table.path, row.line, stamp)
        place = None if number is None else int(number)
        rows.append(Row(image=name, sample=place, stamp_s=stamp_s, line=row.line))
    return rows
