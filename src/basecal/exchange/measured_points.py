"""A table of points in space, in the unit that its header names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.errors import DatasetError
from basecal.exchange.columns import read_table_text
from basecal.exchange.controller_poses import column_unit, keyed_rows, plain_column
from basecal.exchange.importing.imported import Row
from basecal.exchange.importing.text_table import read_text_table, rows_of_numbers
from basecal.geometry import Array

_AXES = ("x", "y", "z")
_ACCEPTED = "expected a header with x, y, z and their unit, such as x_mm, y_mm, z_mm"


@dataclass(frozen=True, eq=False)
class PointTable:
    """Points, a row each.

    Attributes:
        path: Where they were read.
        rows: What says where each belongs.
        points_m: (n, 3).
        targets: Whose points they are; empty if the table does not say.
        unit: What lengths were in, in words.
    """

    path: str
    rows: tuple[Row, ...]
    points_m: Array
    targets: tuple[str, ...]
    unit: str

    @staticmethod
    def read(path: str, length_m: float | None) -> PointTable:
        """The table of a file.

        Args:
            path: Text in any usual separator.
            length_m: A length in the file [m], where its header does not say.

        Raises:
            DatasetError: if it has no x, y, z, or lengths have no unit or two.
        """
        table = read_text_table(read_table_text(path, "a table of points"), path, _AXES)
        by_name = {plain_column(column): column for column in table.header or ()}
        if not by_name.keys() >= set(_AXES):
            raise DatasetError(path, f"has columns {', '.join(table.header or ()) or 'without names'}; {_ACCEPTED}")
        columns = [by_name[axis] for axis in _AXES]
        name, size = _unit(path, columns, length_m)
        points = np.array(list(rows_of_numbers(table, columns))) * size
        targets = table.names("target", "reflector", "point", "marker", "name") or ()
        return PointTable(path, tuple(keyed_rows(table)), points, tuple(targets), name)


def _unit(path: str, columns: list[str], length_m: float | None) -> tuple[str, float]:
    """Name and size of the unit of lengths."""
    found = {column_unit(column) for column in columns} - {None}
    sizes = {size for _, size in filter(None, found)} | (set() if length_m is None else {length_m})
    if len(sizes) != 1:
        why = "do not say their unit: give --length-unit" if not sizes else "have several units, or another than stated"
        raise DatasetError(path, f"{', '.join(columns)} {why}")
    size = sizes.pop()
    return next((name for name, _ in filter(None, found)), f"{1e3 * size:g} mm"), size
