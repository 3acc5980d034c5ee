"""Tests of tables written by columns, equal in Parquet and CSV."""

from __future__ import annotations

import csv
import importlib.util

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.studies.columns import write_columns

BATCHES = [{"name": ["a", None], "value": np.array([1.5, np.nan])}, {"name": ["b"], "value": np.array([2.0])}]


def test_parquet_contains_all_rows(tmp_path) -> None:
    """Batches follow one another, and unknown values are missing."""
    pq = pytest.importorskip("pyarrow.parquet")
    path = write_columns(tmp_path, iter(BATCHES))
    assert path.name == "table.parquet"
    assert pq.read_table(path).to_pydict() == {"name": ["a", None, "b"], "value": [1.5, None, 2.0]}


def test_csv_is_written_without_pyarrow(tmp_path, monkeypatch) -> None:
    """CSV has the same rows as Parquet, with empty fields for unknown values."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    path = write_columns(tmp_path, iter(BATCHES))
    with path.open(newline="") as file:
        assert list(csv.reader(file)) == [["name", "value"], ["a", "1.5"], ["", ""], ["b", "2.0"]]


def test_missing_folder_is_reported(tmp_path) -> None:
    """A missing folder is reported in one line, and no partial file remains."""
    with pytest.raises(InputError, match="cannot be written"):
        write_columns(tmp_path / "none", iter(BATCHES))
