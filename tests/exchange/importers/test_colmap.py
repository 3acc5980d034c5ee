"""`basecal import colmap`."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.cli import main
from lens_texts import COLMAP, tells_the_lens


def test_the_lens(tmp_path: Path) -> None:
    """A camera of a new cell has it, half a pixel off as COLMAP counts."""
    assert tells_the_lens(tmp_path, "colmap", "cameras.bin", COLMAP)


def test_one_of_several(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is asked which, and takes the one that is named; of a folder the file in it."""
    first = "1 OPENCV 640 480 600 601 320.5 240.5 0.1 -0.2 0 0\n"
    (tmp_path / "cameras.txt").write_text(first + first.replace("1 OPENCV", "7 OPENCV").replace("600", "650"))
    words = ["import", "colmap", str(tmp_path / "c"), str(tmp_path), "--camera", "wrist", "--on", "left"]
    assert main(words) == 3
    assert "has cameras 1, 7: say which one by --camera-id" in capsys.readouterr().err
    assert not (tmp_path / "c").exists()
    assert main([*words, "--camera-id", "7"]) == 0
    assert "650" in (tmp_path / "c" / "cell.yaml").read_text()
