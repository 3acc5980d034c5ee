"""Tests of `basecal import camera-info`."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.cell.files import read_cell
from basecal.cli import main
from lens_texts import CAMERA_INFO, reads_lens


def test_lens_is_imported_into_new_cell(tmp_path: Path) -> None:
    """A camera of a new cell has the lens."""
    assert reads_lens(tmp_path, "camera-info", "a.yaml", CAMERA_INFO.format(width=640))


def test_lens_is_added_to_cell_with_images(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The lens is written to cell.yaml, and handwritten parts are kept.

    A lens of another image size is refused with both sizes.
    """
    cell = tmp_path / "cell"
    (cell / "recording" / "images" / "wrist").mkdir(parents=True)
    cv2.imwrite(str(cell / "recording" / "images" / "wrist" / "0.png"), np.zeros((480, 640), np.uint8))
    (cell / "recording" / "samples.jsonl").write_text('{"sample": 0, "images": {"wrist": "images/wrist/0.png"}}\n')
    (cell / "cell.yaml").write_text(
        "schema: basecal/cell/1\nreference: arm  # by the door\nrobots: {arm: {}}\ncameras:\n  wrist: {on: arm}\n"
    )
    for width in (640, 1280):
        (tmp_path / f"{width}.yaml").write_text(CAMERA_INFO.format(width=width))
    assert main(["import", "camera-info", str(cell), str(tmp_path / "1280.yaml"), "--camera", "wrist"]) == 3
    stderr = capsys.readouterr().err
    assert "1280.yaml is of 1280 x 480 px, recording/images/wrist/0.png has 640 x 480" in stderr
    assert main(["import", "camera-info", str(cell), str(tmp_path / "640.yaml"), "--camera", "wrist"]) == 0
    assert "written to cell.yaml: cameras.wrist.model" in capsys.readouterr().out
    lens = read_cell(cell).cameras["wrist"].intrinsics
    assert lens is not None
    assert lens.camera is not None
    np.testing.assert_array_equal(lens.camera.parameters, [600, 601, 320, 240, 0.1, -0.2, 0, 0, 0])
    assert "# by the door" in (cell / "cell.yaml").read_text()
