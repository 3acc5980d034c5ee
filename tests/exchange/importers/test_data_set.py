"""`basecal import industrial-calibration`."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main

TEXT = """\
data:
  - image: 0.png
    pose: 0.yaml
  - image: 1.png
    pose: 1.yaml
intrinsics: {fx: 135.2, fy: 135.6, cx: 78.9, cy: 62.7}
static_camera: true
target_finder:
  type: CharucoGridTargetFinder
  rows: 7
  cols: 5
  chessboard_dim: 0.036195
  aruco_marker_dim: 0.018256
  dictionary: 10
"""


def test_a_data_set_in_one_file(tmp_path: Path) -> None:
    """Poses, images, the board and a start for the lens are in a new cell, and what carries the camera is known."""
    for i in range(2):
        cv2.imwrite(str(tmp_path / f"{i}.png"), np.full((120, 160), 128, np.uint8))
        (tmp_path / f"{i}.yaml").write_text(f"x: 0.{i + 1}\ny: 0.2\nz: 0.3\nqz: 0\nqx: 1\nqw: 0\nqy: 0\n")
    (tmp_path / "cal_data.yaml").write_text(TEXT)
    assert main(["import", "industrial-calibration", str(tmp_path / "c"), str(tmp_path / "cal_data.yaml")]) == 0
    cell, samples = read_cell(tmp_path / "c"), read_recording(tmp_path / "c").samples
    ((_, camera),) = cell.cameras.items()
    ((_, target),) = cell.targets.items()
    assert camera.on == "world"
    assert target.target is not None
    assert (target.target.options["squares"], target.target.options["dictionary"]) == ([5, 7], "DICT_6X6_250")
    (state,) = samples[1].robots.values()
    assert state.base_from_flange is not None
    np.testing.assert_allclose(state.base_from_flange.translation, [0.2, 0.2, 0.3])
    assert all((tmp_path / "c" / sample.images[camera.name]).exists() for sample in samples)
