"""What type checkers of users see of the public names."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
USE = """
import numpy as np

import basecal
from basecal import SE3, PoseEstimate

calibration, cell = basecal.read_calibration("x"), basecal.read_cell("x")
text: str = calibration.to_ur("a_from_b", cell=cell, folder="x", urdf=["x.urdf"])
text = basecal.export(calibration, "ur", folder="x", urdf=["x.urdf"])
pose = SE3(np.eye(3), [0, 0, 0])
moved: np.typing.NDArray[np.float64] = pose @ [1.0, 2.0, 3.0]
each: list[SE3] = [q @ pose for q in SE3.exp(np.zeros((3, 6)))]
estimate: PoseEstimate = pose @ calibration["a_from_b"] @ pose @ calibration["b_from_c"]
"""
MISUSE = """
calibration.to_sdf()
calibration.verdct
pose @ None
"""


@pytest.mark.journey
def test_use_passes_and_misuse_does_not(tmp_path: Path) -> None:
    """The methods of exports, sequences of numbers in place of arrays, and known transforms beside estimates."""
    path = tmp_path / "use.py"
    path.write_text(USE + MISUSE, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", str(path)]
    environment = {**os.environ, "MYPYPATH": str(ROOT / "src")}
    said = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment).stdout
    lines = {int(line.split(":")[1]) for line in said.splitlines() if " error: " in line}
    first = USE.count("\n") + 2  # after an empty line
    assert lines == set(range(first, first + 3)), said
