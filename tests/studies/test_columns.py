"""Columns as a file: the same in Parquet and in CSV."""

from __future__ import annotations

import csv
import importlib.util

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.studies.columns import write_columns

BATCHES = [{"name": ["a", None], "value": np.array([1.5, np.nan])}, {"name": ["b"], "value": np.array([2.0])}]


def test_parquet_holds_all_rows(tmp_path) -> None:
    """Batches one after another, what is not known missing."""
    pq = pytest.importorskip("pyarrow.parquet")
    path = write_columns(tmp_path, iter(BATCHES))
    assert path.name == "table.parquet"
    assert pq.read_table(path).to_pydict() == {"name": ["a", None, "b"], "value": [1.5, None, 2.0]}


def test_csv_holds_the_same(tmp_path, monkeypatch) -> None:
    """Where pyarrow is not installed; nothing stands where nothing is known."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    path = write_columns(tmp_path, iter(BATCHES))
    with path.open(newline="") as file:
        assert list(csv.reader(file)) == [["name", "value"], ["a", "1.5"], ["", ""], ["b", "2.0"]]


def test_a_folder_that_is_not_there_is_told(tmp_path) -> None:
    """In one line, and no part is left."""
    with pytest.raises(InputError, match="cannot be written"):
        write_columns(tmp_path / "none", iter(BATCHES))
