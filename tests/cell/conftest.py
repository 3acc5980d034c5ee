"""A cell on disk."""

from __future__ import annotations

from pathlib import Path

import pytest

from cell_example import CELL, LINES, URDF, journal


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder of a cell on disk that contains one of everything."""
    (tmp_path / "cell.yaml").write_text(CELL)
    (tmp_path / "hand.urdf").write_text(URDF)
    (tmp_path / "recording").mkdir()
    (tmp_path / "recording" / "samples.jsonl").write_bytes(journal(*LINES))
    return tmp_path
