"""What is kept of a cell before a change."""

from __future__ import annotations

import json
from pathlib import Path

from basecal.cell.format.originals import keep_originals


def test_each_change_has_a_folder_of_its_own(tmp_path: Path) -> None:
    """Two changes within a second keep what was there before each; a file that is not there is none of them."""
    path = tmp_path / "cell.yaml"
    path.write_text("first")
    kept = [keep_originals(tmp_path, (path, tmp_path / "none"), {"done": "a change"})]
    path.write_text("second")
    kept.append(keep_originals(tmp_path, (path,), {"done": "another"}))
    assert [(each / "cell.yaml").read_text() for each in kept] == ["first", "second"]
    assert json.loads((kept[1] / "change.json").read_text()) == {"done": "another"}
    assert len(list(kept[0].iterdir())) == 2
