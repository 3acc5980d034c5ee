"""What imports of lenses share."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from basecal.cli import main
from basecal.cli.lens_import import known_cell, picture_size


def test_the_size_of_a_picture(tmp_path: Path) -> None:
    """By its first bytes; of what is no picture, or not there, nothing is said."""
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((48, 64), np.uint8))
    (tmp_path / "b.png").write_bytes(b"no picture")
    assert picture_size(tmp_path / "a.png") == (64, 48)
    assert picture_size(tmp_path / "b.png") is None
    assert picture_size(tmp_path / "c.png") is None


def test_a_cell_that_may_be_there(tmp_path: Path) -> None:
    """None before it is made."""
    assert known_cell(tmp_path / "c") is None
    main(["new", str(tmp_path / "c"), "--names", "left"])
    cell = known_cell(tmp_path / "c")
    assert cell is not None
    assert [*cell.robots] == ["left"]
