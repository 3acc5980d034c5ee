"""Tests of touch points: tips of two tools at one point are measurements and verify a calibration."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.touch_cells import MARKS, TIPS, lines_text, touch_cell, touch_lines

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.drift.verify import verify
from basecal.cell import Recording, Unknown
from basecal.cell.files import read_cell, recording_from_text
from basecal.cli import main
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.reporting.drift_text import verification_text

CELL = """schema: basecal/cell/1
reference: eye
robots:
  eye: {noise: {sigma_t_m: 1e-4, sigma_r_rad: 2e-4}}
  hand: {noise: {sigma_t_m: 1e-4, sigma_r_rad: 2e-4}}
tips:
  eye_tip: {on: eye, offset: {status: fixed, t_m: [0, 0, 0.12]}}
  hand_tip: {on: hand, offset: {status: fixed, t_m: [0, 0, 0.1]}}
"""
BASE = "eye_base_from_hand_base"
TRUTH = SE3.from_rpy((0.02, -0.03, 3.0), (1.0, 0.1, 0.05))
SIGMA_M = 1e-4


def touches(rng: np.random.Generator, count: int, base: SE3 = TRUTH) -> str:
    """Lines of samples in which both tips meet, with robot errors and a tenth of a millimetre."""
    lines = []
    for number in range(count):
        point, robots = np.array([0.5, 0, 0.4]) + rng.uniform(-0.25, 0.25, 3), {}
        for name, stands, tip in (("eye", SE3.identity(), 0.12), ("hand", base, 0.1)):
            turn = SE3.from_rotvec(rng.normal(0, 0.6, 3), np.zeros(3)).rotation
            met = point + SIGMA_M * rng.standard_normal(3) if name == "hand" else point
            true = stands.inverse() @ SE3(turn, met - turn @ [0, 0, tip])
            recorded_pose = true @ SE3.exp(rng.standard_normal(6) * np.repeat([1e-4, 2e-4], 3))
            robots[name] = {
                "base_from_flange": {
                    "t_m": recorded_pose.translation.tolist(),
                    "q_xyzw": recorded_pose.quaternion.tolist(),
                }
            }
        seen = {"tip": "eye_tip", "tip2": "hand_tip"}
        lines.append(json.dumps({"sample": number, "robots": robots, "observations": [{**seen, "sigma_m": SIGMA_M}]}))
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    folder = tmp_path_factory.mktemp("touches")
    (Path(folder) / "cell.yaml").write_text(CELL)
    return read_cell(folder)


def read_samples(cell, text: str) -> Recording:
    """The samples of these lines."""
    return recording_from_text(text.encode(), ".", cell)


@pytest.mark.slow
def test_touches_alone_determine_base(cell):
    """The NEES of the base has mean 6 over 60 cells of ten touches, within 3.5 standard errors, sqrt(12 / 60)."""
    found = []
    for seed in range(60):
        base = solve(cell, read_samples(cell, touches(np.random.default_rng(seed), 10))).transforms[BASE]
        off = (base.mean.inverse() @ TRUTH).log()
        found.append(off @ np.linalg.solve(base.covariance, off))
    assert np.mean(found) == pytest.approx(6.0, abs=3.5 * np.sqrt(12 / 60))


@pytest.mark.journey
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_calibrate_prints_good(tmp_path, capsys, seed):
    """The command finds the base from touches alone, exact (no seed) or with the stated noise."""
    rng = np.random.default_rng(seed or 0)
    exact = SimpleNamespace(uniform=rng.uniform, normal=rng.normal, standard_normal=np.zeros)
    (tmp_path / "recording").mkdir()
    (tmp_path / "cell.yaml").write_text(CELL)
    (tmp_path / "recording" / "samples.jsonl").write_text(touches(exact if seed is None else rng, 12))
    assert main(["calibrate", str(tmp_path)]) == 0
    assert capsys.readouterr().out.startswith("GOOD: expected error ")


def test_documented_touches_match_cell():
    """The tips and the observation of docs/verify.md are those of this cell, which the command calibrates."""
    text = (Path(__file__).parents[3] / "docs" / "verify.md").read_text(encoding="utf-8")
    assert CELL[CELL.index("tips:") :] in text
    assert '"observations": [{"tip": "eye_tip", "tip2": "hand_tip", "sigma_m": 2e-4}]' in text


def test_free_tips_have_no_rotation(cell):
    """The mount of a tip has three unknowns, so the base is found beside it."""
    free = cell.with_transform("eye_flange_from_eye_tip", Unknown())
    calibration = calibrate(free, read_samples(free, touches(np.random.default_rng(2), 20)))
    assert calibration.verdict == "good"
    assert "eye_flange_from_eye_tip" in calibration.points


def test_touches_verify_calibration(cell):
    """Four later touches show that nothing moved, or that the base moved by 3 mm."""
    rng = np.random.default_rng(1)
    calibration = calibrate(cell, read_samples(cell, touches(rng, 12)))
    assert verify(cell, calibration, read_samples(cell, touches(rng, 4))).moved is False
    shifted = TRUTH @ SE3(np.eye(3), np.array([3e-3, 0, 0]))
    found = verify(cell, calibration, read_samples(cell, touches(rng, 4, shifted)))
    assert found.moved
    assert "hand_base" in [found.shift.frame, *(other.frame for other in found.alternatives)]


@pytest.mark.journey
@pytest.mark.parametrize("about", ["mark_b", "hand_tip"])
def test_moved_point_has_no_rotation(monkeypatch, about):
    """A mark or tip moved by 3 mm is found with three freedoms, and reported without an angle."""
    rng, described = np.random.default_rng(0), touch_cell()
    calibration = calibrate(described, read_samples(described, lines_text(touch_lines(rng, 24, 2e-4, MARKS, True))))
    off = np.array([0.0, 3e-3, 0.0])
    if about == "hand_tip":
        monkeypatch.setitem(TIPS, "hand", TIPS["hand"] + off)
    marks = {**MARKS, "mark_b": MARKS["mark_b"] + off} if about == "mark_b" else MARKS
    found = verify(described, calibration, read_samples(described, lines_text(touch_lines(rng, 8, 2e-4, marks, True))))
    assert found.shift.frame == about
    assert found.shift.freedoms == 3
    assert np.linalg.norm(found.shift.size[:3]) == pytest.approx(3e-3, abs=4e-4)
    assert "deg" not in verification_text(found)
