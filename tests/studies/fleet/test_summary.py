"""Tests of the summary and the table of a fleet."""

from __future__ import annotations

import pytest

from basecal.errors import InputError
from basecal.studies.fleet.row import COLUMNS
from basecal.studies.fleet.run import Fleet
from basecal.studies.fleet.summary import fleet_rows, summarise_fleet, write_fleet_table
from fleet_example import ROWS


def test_summary_has_counts_and_quantiles(tmp_path) -> None:
    """Verdicts and findings are counted, and quantiles are those of the cells that have the number."""
    found = summarise_fleet(Fleet(tmp_path, ("a", "b", "<c>", "d"), tmp_path / "out"), ROWS)
    assert found["verdicts"] == {"good": 1, "doubtful": 2, "refused": 0, "unreadable": 1, "failed": 0}
    assert found["findings"] == {"drift": 2, "few-images": 1}
    assert found["sigma_mm"]["median"] == 1.5
    assert found["sigma_mm"]["largest"] == 2.5
    assert found["held_out_mm"] is None


def test_table_has_one_row_per_cell(tmp_path) -> None:
    """The table has all columns, with missing values for unknown ones."""
    pq = pytest.importorskip("pyarrow.parquet")
    table = pq.read_table(write_fleet_table(ROWS, tmp_path)).to_pydict()
    assert tuple(table) == COLUMNS
    assert table["cell"] == ["a", "b", "<c>", "d"]
    assert table["sigma_mm"] == [0.5, 1.5, None, 2.5]
    assert table["samples"] == [30, 30, None, 30]


def test_missing_row_is_reported(tmp_path) -> None:
    """The error states what to do."""
    with pytest.raises(InputError, match="lacks the row of a: run the command again"):
        fleet_rows(Fleet(tmp_path, ("a",), tmp_path / "out"))
