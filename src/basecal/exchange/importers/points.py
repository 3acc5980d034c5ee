"""Points that a laser tracker, a total station or motion capture measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from basecal.cell import PointObservation
from basecal.errors import DatasetError, UsageError
from basecal.exchange.importing.cell_content import known_cell
from basecal.exchange.importing.imported import Imported, Row
from basecal.exchange.measured_points import PointTable
from basecal.exchange.poses import LengthUnit, unit_length_m


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
    """Import points that an instrument measured: reflectors or markers on a robot.

    The file is a table with a header. Its columns are x, y, z with their unit,
    such as `x_mm` or `y [inch]`, and `target` if there are several reflectors.
    Rows belong to the samples that are there in order, unless a column `sample`
    or `stamp_s` says otherwise; rows of one sample are joined. Nothing need be
    known of where the instrument or the reflectors are.

    For example:

        basecal import poses mycell arm.txt --robot arm --format kuka
        basecal import points mycell tracker.csv --camera tracker --target ball \\
            --robot arm

    Args:
        cell: Folder of the cell.
        file: Measured points.
        camera: Name of the instrument; added to the cell where it is new.
        target: Name of the reflector, where the table has no column `target`.
        robot: What carries reflectors that are new.
        length_unit: What lengths are in, where the header does not say.
        sigma_m: Sigma of a point per axis [m]; estimated where left out.

    Raises:
        UsageError: if options do not go together, or neither the header nor an option has the unit.
        InputError: if the file cannot be read.
    """
    table = PointTable.read(str(file), None if length_unit is None else unit_length_m(length_unit))
    names = table.targets or ((target,) * len(table.rows) if target else ())
    if not names or (table.targets and target):
        raise UsageError("say which reflector was measured, either by --target or by a column `target`")
    known = known_cell(cell)
    new = [name for name in dict.fromkeys(names) if name not in known.targets]
    if new and robot is None:
        raise UsageError(f"--robot is missing: the one that carries {', '.join(new)}")
    reflector = {"on": robot, "kind": "points", "points_m": [[0.0, 0.0, 0.0]]}
    entry: dict[str, dict[str, object]] = {"targets": {name: dict(reflector) for name in new}}
    if camera not in known.cameras:
        entry["cameras"] = {camera: {"kind": "tracker", "on": "world"}}
    rows = _join_rows(table, names, camera, sigma_m)
    what = f"{len(names)} points of {', '.join(dict.fromkeys(names))} in {camera}, {table.unit}"
    return Imported(str(file), what, rows, entry, advice="check the unit of the header, and --length-unit")


def _join_rows(table: PointTable, names: Sequence[str], camera: str, sigma_m: float | None) -> tuple[Row, ...]:
    """Rows of one sample as one, with a view of each reflector.

    Raises:
        DatasetError: if a reflector is twice in a sample.
    """
    found: dict[object, Row] = {}
    for k, (row, name) in enumerate(zip(table.rows, names, strict=True)):
        sigma = None if sigma_m is None else np.array([sigma_m])
        seen = PointObservation(camera, name, np.zeros(1, dtype=np.int64), table.points_m[[k]], sigma)
        key = row.sample if row.sample is not None else row.stamp_s if row.stamp_s is not None else k
        before = found.get(key, row)
        if any(o.target == name for o in before.observations):
            raise DatasetError(table.path, f"{name!r} is measured twice in one sample; keep one")
        found[key] = replace(before, observations=(*before.observations, seen))
    return tuple(found.values())
