"""`basecal import kalibr`."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.cell.files import read_cell
from basecal.cli import main
from lens_texts import KALIBR, tells_the_lens


def test_the_lens(tmp_path: Path) -> None:
    """A camera of a new cell has it."""
    assert tells_the_lens(tmp_path, "kalibr", "a.yaml", KALIBR.format(name="cam0"))


def test_kalibrs_choices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of several cameras one is chosen by its name in the file; a target goes into the same cell."""
    (tmp_path / "chain.yaml").write_text(KALIBR.format(name="cam0") + KALIBR.format(name="cam1"))
    cell = str(tmp_path / "c")
    words = ["import", "kalibr", cell, str(tmp_path / "chain.yaml"), "--camera", "wrist", "--on", "left"]
    assert main(words) == 3
    assert "has cam0, cam1: say which one by --camera-of-file" in capsys.readouterr().err
    assert main([*words, "--camera-of-file", "cam1"]) == 0
    (tmp_path / "t.yaml").write_text(
        "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n"
    )
    assert main(["import", "kalibr", cell, str(tmp_path / "t.yaml"), "--target", "grid", "--on", "world"]) == 0
    target = read_cell(cell).targets["grid"].target
    assert target is not None
    assert dict(target.options)["tags"] == [6, 5]
