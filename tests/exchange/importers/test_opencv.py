"""`basecal import opencv`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell
from basecal.cli import main
from lens_texts import OPENCV, tells_the_lens


def test_the_lens(tmp_path: Path) -> None:
    """A camera of a new cell has it."""
    assert tells_the_lens(tmp_path, "opencv", "a.yml", OPENCV + "D: [0.1, -0.2, 0., 0.]\n")


def test_opencvs_size_by_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An archive has no size: the option gives it; it does not overrule a file's."""
    np.savez(tmp_path / "l.npz", mtx=[[600, 0, 320], [0, 601, 240], [0, 0, 1]], dist=[0.1, 0, 0, 0, 0])
    words = ["import", "opencv", str(tmp_path / "c"), "--size-px", "640", "480"]
    assert main([*words, str(tmp_path / "l.npz")]) == 0
    assert read_cell(tmp_path / "c").cameras["camera"].size_px == (640, 480)
    (tmp_path / "a.yml").write_text(OPENCV.replace("640", "1280"))
    assert main([*words, str(tmp_path / "a.yml")]) == 3
    assert "a.yml is of 1280 x 480 px: leave --size-px away" in capsys.readouterr().err
