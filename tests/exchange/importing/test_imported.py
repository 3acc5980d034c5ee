"""What an import read, as a noun."""

from __future__ import annotations

import dataclasses

import pytest

from basecal.exchange.importing.imported import Imported, Row


def test_nothing_is_said_by_default() -> None:
    """A row without keys is paired by order, and an import without a cell adds nothing to it."""
    row, imported = Row(), Imported("a.csv", "poses")
    assert (row.image, row.sample, row.stamp_s) == (None, None, None)
    assert (imported.rows, dict(imported.cell), imported.new_cell) == ((), {}, None)
    with pytest.raises(dataclasses.FrozenInstanceError):
        row.sample = 3  # type: ignore[misc]
