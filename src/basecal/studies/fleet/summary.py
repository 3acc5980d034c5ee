"""Summary of a fleet's rows, and their table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from basecal.errors import InputError
from basecal.studies.columns import quantiles, write_columns
from basecal.studies.fleet.row import COLUMNS, VERDICTS
from basecal.studies.fleet.run import SCHEMA, Fleet

_LISTS = ("cell", "verdict", "findings", "said", "samples", "transform")
_SPREAD = ("sigma_mm", "sigma_deg", "held_out_mm", "held_out_deg", "time_s")

Row = Mapping[str, Any]


def fleet_rows(fleet: Fleet) -> list[Row]:
    """The rows of all cells, in the fleet's order.

    Raises:
        InputError: if a row is missing.
    """
    found = []
    for cell in fleet.cells:
        row = fleet.row(cell)
        if row is None:
            raise InputError(f"{fleet.output} lacks the row of {cell}: run the command again to complete it")
        found.append(row)
    return found


def write_fleet_table(rows: Sequence[Row], folder: Path) -> Path:
    """Write a table with a row for each cell into a folder; its path.

    Raises:
        InputError: if the file cannot be written.
    """
    columns: dict[str, Any] = {name: [row[name] for row in rows] for name in COLUMNS}
    for name in columns.keys() - _LISTS:
        columns[name] = np.array([np.nan if value is None else value for value in columns[name]], dtype=float)
    return write_columns(folder, iter([columns]))


def summarise_fleet(fleet: Fleet, rows: Sequence[Row]) -> dict[str, Any]:
    """Counts of verdicts and findings, and quantiles of numbers of a fleet, as plain data."""
    verdicts = Counter(row["verdict"] for row in rows)
    return {
        "schema": SCHEMA,
        "cells": len(rows),
        "verdicts": {verdict: verdicts[verdict] for verdict in VERDICTS},
        "findings": dict(Counter(code for row in rows for code in row["findings"].split()).most_common()),
        **{name: _spread(row[name] for row in rows) for name in _SPREAD},
        "folder": str(fleet.output),
    }


def _spread(values: Iterable[float | None]) -> dict[str, float] | None:
    """Quantiles and maximum of the known values; None if there are none."""
    known = [value for value in values if value is not None]
    return {**quantiles(known), "largest": max(known)} if known else None
