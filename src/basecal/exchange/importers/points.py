"""Import of points measured by a laser tracker, a total station or motion capture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from basecal.cell import PointObservation
from basecal.errors import DatasetError, UsageError, count_text, list_names
from basecal.exchange.columns import read_table_text
from basecal.exchange.controller_poses import column_unit, keyed_rows, plain_column
from basecal.exchange.importing.imported import Imported, Row, known_cell
from basecal.exchange.importing.text_table import read_text_table, rows_of_numbers
from basecal.exchange.poses import LengthUnit, unit_length_m
from basecal.geometry import Array

_AXES = ("x", "y", "z")
_ACCEPTED = "expected a header with x, y, z and their unit, such as x_mm, y_mm, z_mm"


def read_points(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera: str,
    target: str | None = None,
    robot: str | None = None,
    length_unit: LengthUnit | None = None,
    sigma_m: float | None = None,
) -> Imported:
    """Import measured points of reflectors or markers on a robot.

    The file is a table with a header. Its columns are x, y, z with their unit,
    such as `x_mm` or `y [inch]`, and `target` if there are several reflectors.
    Rows are assigned to the existing samples in order, unless a column `sample`
    or `stamp_s` assigns them; rows of one sample are joined. The poses of the
    instrument and the reflectors may be unknown.

    For example:

        basecal import poses mycell arm.txt --robot arm --format kuka
        basecal import points mycell tracker.csv --camera tracker --target ball \\
            --robot arm

    Args:
        cell: Folder of the cell.
        file: Measured points.
        camera: Name of the instrument; a new instrument is added to the cell.
        target: Name of the reflector, if the table has no column `target`.
        robot: Robot that carries new reflectors.
        length_unit: Unit of lengths, if the header does not state it.
        sigma_m: Sigma of a point per axis [m]; estimated if not given.

    Raises:
        UsageError: if options are inconsistent.
        InputError: if the file cannot be read, or the unit of lengths is missing or ambiguous.
    """
    table = PointTable.read(str(file), None if length_unit is None else unit_length_m(length_unit))
    names = table.targets or ((target,) * len(table.rows) if target else ())
    if not names or (table.targets and target):
        raise UsageError("name the measured reflector with either --target or a column `target`")
    known = known_cell(cell)
    new = [name for name in dict.fromkeys(names) if name not in known.targets]
    if new and robot is None:
        raise UsageError(f"--robot is missing: give the carrier of {', '.join(new)}")
    reflector = {"on": robot, "kind": "points", "points_m": [[0.0, 0.0, 0.0]]}
    entry: dict[str, dict[str, object]] = {"targets": {name: dict(reflector) for name in new}}
    if camera not in known.cameras:
        entry["cameras"] = {camera: {"kind": "tracker", "on": "world"}}
    rows = _join_rows(table, names, camera, sigma_m)
    what = f"{count_text(len(names), 'point')} of {', '.join(dict.fromkeys(names))} in {camera}, {table.unit}"
    return Imported(str(file), what, rows, entry, advice="check the unit of the header, and --length-unit")


def _join_rows(table: PointTable, names: Sequence[str], camera: str, sigma_m: float | None) -> tuple[Row, ...]:
    """Join the rows of each sample into one row with a view of each reflector.

    Raises:
        DatasetError: if a sample has a reflector twice.
    """
    found: dict[object, Row] = {}
    for k, (row, name) in enumerate(zip(table.rows, names, strict=True)):
        sigma = None if sigma_m is None else np.array([sigma_m])
        view = PointObservation(camera, name, np.zeros(1, dtype=np.int64), table.points_m[[k]], sigma)
        key = row.sample if row.sample is not None else row.stamp_s if row.stamp_s is not None else k
        joined = found.get(key, row)
        if any(o.target == name for o in joined.observations):
            raise DatasetError(table.path, f"{name!r} is measured twice in one sample; keep one", row.line)
        found[key] = replace(joined, observations=(*joined.observations, view))
    return tuple(found.values())


@dataclass(frozen=True, eq=False)
class PointTable:
    """A table of points, one per row.

    Attributes:
        path: Path of the file.
        rows: Rows with the keys that assign them to samples.
        points_m: (n, 3) points [m].
        targets: Names of the reflectors; empty if the table does not state them.
        unit: Name of the file's unit of length.
    """

    path: str
    rows: tuple[Row, ...]
    points_m: Array
    targets: tuple[str, ...]
    unit: str

    @staticmethod
    def read(path: str, length_m: float | None) -> PointTable:
        """Read a table of points.

        Args:
            path: Table with any usual separator.
            length_m: Unit of lengths [m], if the header does not state it.

        Raises:
            DatasetError: if x, y or z is missing, or the unit of lengths is missing or ambiguous.
        """
        table = read_text_table(read_table_text(path, "a table of points"), path, _AXES)
        found = [[column for column in table.header or () if plain_column(column) == axis] for axis in _AXES]
        if not all(found):
            raise DatasetError(path, f"has columns {', '.join(table.header or ()) or 'without names'}; {_ACCEPTED}")
        if double := next((each for each in found if len(each) > 1), None):
            raise DatasetError(path, f"has two columns of one coordinate, {list_names(double)}: keep one")
        columns = [column for (column,) in found]
        name, size = _unit(path, columns, length_m)
        points = np.array(list(rows_of_numbers(table, columns))) * size
        targets = table.names("target", "reflector", "point", "marker", "name") or ()
        return PointTable(path, tuple(keyed_rows(table)), points, tuple(targets), name)


def _unit(path: str, columns: list[str], length_m: float | None) -> tuple[str, float]:
    """Name and size of the unit of lengths."""
    found = {column_unit(column) for column in columns} - {None}
    sizes = {size for _, size in filter(None, found)} | (set() if length_m is None else {length_m})
    if len(sizes) != 1:
        why = "have no unit: give --length-unit" if not sizes else "have several units, or another than --length-unit"
        raise DatasetError(path, f"{', '.join(columns)} {why}")
    size = sizes.pop()
    return next((name for name, _ in filter(None, found)), f"{1e3 * size:g} mm"), size
