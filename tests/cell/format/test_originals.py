"""Tests of the copies of a cell's files kept before a change."""

from __future__ import annotations

import json
from pathlib import Path

from basecal.cell.format.originals import keep_originals


def test_each_change_keeps_originals_in_own_folder(tmp_path: Path) -> None:
    """Two changes within a second each keep the previous files; a missing file is not kept."""
    path = tmp_path / "cell.yaml"
    path.write_text("first")
    kept = [keep_originals(tmp_path, (path, tmp_path / "none"), {"done": "a change"})]
    path.write_text("second")
    kept.append(keep_originals(tmp_path, (path,), {"done": "another"}))
    assert [(each / "cell.yaml").read_text() for each in kept] == ["first", "second"]
    assert json.loads((kept[1] / "change.json").read_text()) == {"done": "another"}
    assert len(list(kept[0].iterdir())) == 2
