"""One lens in the formats of five programs, and a check that an import reads it."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from basecal.cell.files import read_cell
from basecal.cli import main

CAMERA_INFO = """\
image_width: {width}
image_height: 480
camera_name: c
camera_matrix: {{rows: 3, cols: 3, data: [600, 0, 320, 0, 601, 240, 0, 0, 1]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0.1, -0.2, 0, 0, 0]}}
"""
KALIBR = """\
{name}:
  camera_model: pinhole
  distortion_coeffs: [0.1, -0.2, 0, 0]
  distortion_model: radtan
  intrinsics: [600, 601, 320, 240]
  resolution: [640, 480]
"""
CAMERAMODEL = """\
{ 'lensmodel': 'LENSMODEL_OPENCV4', 'intrinsics': [600, 601, 320, 240, 0.1, -0.2, 0, 0],
  'extrinsics': [0, 0, 0, 0, 0, 0], 'imagersize': [640, 480] }
"""
COLMAP = struct.pack("<QiiQQ8d", 1, 1, 4, 640, 480, 600, 601, 320.5, 240.5, 0.1, -0.2, 0, 0)
OPENCV = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\nK: [600., 0., 320., 0., 601., 240., 0., 0., 1.]\n"


def reads_lens(folder: Path, kind: str, name: str, content: str | bytes, *words: str) -> bool:
    """Import a file into a new cell, and return whether the camera `wrist` on `left` has that lens."""
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    cell = folder / "c"
    if main(["import", kind, str(cell), str(path), "--camera", "wrist", "--on", "left", *words]) != 0:
        return False
    camera = read_cell(cell).cameras["wrist"]
    if camera.intrinsics is None or camera.intrinsics.camera is None:
        return False
    parameters = camera.intrinsics.camera.parameters[:8]
    return (camera.on, camera.size_px) == ("left", (640, 480)) and np.array_equal(
        parameters, [600, 601, 320, 240, 0.1, -0.2, 0, 0]
    )
