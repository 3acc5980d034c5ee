"""Journey: a line with a KUKA and an ABB.

Poses are as shown by their pendants, in millimetres and each maker's angles.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.geometry import SE3, Array
from tests.journeys.raw import (
    BOARD_OPTIONS,
    cell,
    is_pasted,
    is_within_three_sigmas,
    photographs,
    recorded,
    run,
    written,
)

pytestmark = pytest.mark.slow
NAME = "kuka_base_from_abb_base"


def krl(positions: Array, turns: Rotation) -> list[str]:
    """Frames like $POS_ACT in a .dat file: mm, A about z, B about the new y, C about the new x, in degrees (KRL)."""
    rows = zip(1e3 * positions, turns.as_euler("ZYX", degrees=True), strict=True)
    return [
        f"DECL FRAME P{i}={{X {x:.3f},Y {y:.3f},Z {z:.3f},A {a:.4f},B {b:.4f},C {c:.4f}}}"
        for i, ((x, y, z), (a, b, c)) in enumerate(rows, start=1)
    ]


def rapid(positions: Array, turns: Rotation) -> list[str]:
    """Targets like CRobT() in a module: mm, a quaternion with w first, then configuration and external axes."""
    rows = zip(1e3 * positions, turns.as_quat(scalar_first=True), strict=True)
    axes = "[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"
    return [
        f"CONST robtarget p{10 * i}:=[[{x:.3f},{y:.3f},{z:.3f}],[{w:.7f},{a:.7f},{b:.7f},{c:.7f}],{axes}];"
        for i, ((x, y, z), (w, a, b, c)) in enumerate(rows, start=1)
    ]


def pasted_frame(text: str) -> SE3:
    """First frame {X ..., C ...} of KRL in a text."""
    number = r"([-+0-9.]+)"
    found = re.search(r"\{" + ", ".join(f"{key} {number}" for key in "XYZABC") + r"\}", text)
    assert found is not None, text
    x, y, z, *angles = map(float, found.groups())
    return SE3(Rotation.from_euler("ZYX", angles, degrees=True).as_matrix(), 1e-3 * np.array([x, y, z]))


def test_from_pendants_to_a_base_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """From lines of both programs and the camera's images to the frame of the ABB's base for the KUKA."""
    monkeypatch.chdir(tmp_path)
    made = cell(samples=18, seed=5)
    photographs(made, tmp_path, lambda i: f"cam0_{i + 1:04d}.png")
    written(tmp_path / "calib.dat", krl(*recorded(made, "eye")))
    written(tmp_path / "calib.mod", rapid(*recorded(made, "hand")))
    run(
        "basecal import poses line4 --robot kuka calib.dat --format kuka",
        "basecal import poses line4 --robot abb calib.mod --format abb",
        f"basecal import images line4 photos --camera flange_cam --on kuka {BOARD_OPTIONS}",
        "basecal calibrate line4 --tolerance 2mm",
        "basecal export line4 --to kuka -o base.src",
    )
    printed = capsys.readouterr().out
    assert "PASS: expected error " in printed
    assert f"\n{NAME} to " in printed
    assert is_within_three_sigmas(tmp_path / "line4", NAME, made.truth["eye_base_from_hand_base"])
    assert is_pasted(pasted_frame((tmp_path / "base.src").read_text()), tmp_path / "line4", NAME)
