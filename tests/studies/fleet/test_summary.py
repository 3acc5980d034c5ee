"""What a fleet's rows say together."""

from __future__ import annotations

import pytest

from basecal.errors import InputError
from basecal.studies.fleet.row import COLUMNS
from basecal.studies.fleet.run import Fleet
from basecal.studies.fleet.summary import fleet_rows, summarise_fleet, write_fleet_table
from fleet_example import ROWS


def test_counts_and_spreads(tmp_path) -> None:
    """Verdicts and findings are counted, numbers spread over the cells that have them."""
    found = summarise_fleet(Fleet(tmp_path, ("a", "b", "<c>", "d"), tmp_path / "out"), ROWS)
    assert found["verdicts"] == {"good": 1, "doubtful": 2, "refused": 0, "unreadable": 1, "failed": 0}
    assert found["findings"] == {"drift": 2, "few-images": 1}
    assert found["sigma_mm"]["median"] == 1.5
    assert found["sigma_mm"]["largest"] == 2.5
    assert found["held_out_mm"] is None


def test_the_table_has_a_row_for_each_cell(tmp_path) -> None:
    """Of every column, what is not known missing."""
    pq = pytest.importorskip("pyarrow.parquet")
    table = pq.read_table(write_fleet_table(ROWS, tmp_path)).to_pydict()
    assert tuple(table) == COLUMNS
    assert table["cell"] == ["a", "b", "<c>", "d"]
    assert table["sigma_mm"] == [0.5, 1.5, None, 2.5]
    assert table["samples"] == [30, 30, None, 30]


def test_a_row_that_is_not_there_is_told(tmp_path) -> None:
    """With what to do."""
    with pytest.raises(InputError, match="lacks the row of a: run the command again"):
        fleet_rows(Fleet(tmp_path, ("a",), tmp_path / "out"))
