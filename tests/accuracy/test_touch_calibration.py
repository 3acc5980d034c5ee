"""Tests of the calibration of cells of touches."""

from __future__ import annotations

import re

import numpy as np
import pytest
from tests.touch_cells import BASE, MARKS, TIPS, TRUTH, recorded, touch_cell, touch_lines

from basecal.accuracy.calibrate import calibrate

PLATE = {"socket_1": [0.0, 0.0, 0.0], "socket_2": [0.35, 0.0, 0.0], "socket_3": [0.1, 0.3, 0.05]}


@pytest.mark.journey
@pytest.mark.parametrize("is_stated", [True, False])
def test_three_marks_determine_base(is_stated):
    """With unknown tips and marks the answer is good, the base within four sigmas, and the noise correct."""
    cell = touch_cell()
    lines = touch_lines(np.random.default_rng(3), 24, 2e-4, is_stated=is_stated)
    found = calibrate(cell, recorded(cell, lines))
    off = (found[BASE].mean.inverse() @ TRUTH).log()
    assert found.verdict == "good"
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(found[BASE].covariance)))
    assert is_stated or found.noise["touch_m"] == pytest.approx(2e-4, rel=0.5)
    assert {"eye_flange_from_eye_tip", "eye_base_from_mark_c"} <= found.points


@pytest.mark.journey
def test_two_marks_leave_rotation_about_line():
    """Two marks are refused, and the unobservable direction is the line through them."""
    marks = {name: MARKS[name] for name in ("mark_a", "mark_b")}
    cell = touch_cell(list(marks))
    found = calibrate(cell, recorded(cell, touch_lines(np.random.default_rng(1), 24, 2e-4, marks)))
    assert found.verdict == "refused"
    line = (marks["mark_b"] - marks["mark_a"]) / np.linalg.norm(marks["mark_b"] - marks["mark_a"])
    words = f"along ({line[0]:.2f}, {line[1]:.2f}, {line[2]:.2f}) in eye_base is unobservable"
    (finding,) = (each for each in found.findings if words in each.what)
    assert finding.do == (
        "Touch a third mark, at least 0.3 m off the line through mark_a and mark_b, with eye_tip and hand_tip.",
    )


@pytest.mark.journey
def test_plate_is_one_body():
    """Marks of a plate keep their distances, and no finding concerns their priors."""
    cell = touch_cell((), marks={"plate": {"points_m": PLATE}})
    marks = {name: np.array([0.3, -0.2, 0.1]) + at for name, at in PLATE.items()}
    found = calibrate(cell, recorded(cell, touch_lines(np.random.default_rng(1), 24, 1e-4, marks)))
    assert found.verdict == "good"
    assert not found.findings
    assert found["eye_base_from_plate"].mean.translation == pytest.approx([0.3, -0.2, 0.1], abs=1e-3)


@pytest.mark.journey
def test_touch_of_wrong_mark_is_left_out():
    """One of 36 touches with a wrong mark name is left out and named, and the answer is that of the others."""
    cell, lines = touch_cell(), touch_lines(np.random.default_rng(5), 36, 2e-4)
    seen = lines[11]["observations"][0]
    seen["touch"] = "mark_a" if seen["touch"] != "mark_a" else "mark_b"
    found = calibrate(cell, recorded(cell, lines))
    assert [outlier.sample for outlier in found.outliers] == [11]
    off = (found[BASE].mean.inverse() @ TRUTH).log()
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(found[BASE].covariance)))


@pytest.mark.journey
@pytest.mark.parametrize("seed", [1, 4])
def test_moved_mark_is_named(seed):
    """A mark moved by 5 mm at half time is named with its distance, as a step or by left-out touches."""
    lines = touch_lines(np.random.default_rng(seed), 36, 2e-4)
    elsewhere = {**MARKS, "mark_b": MARKS["mark_b"] + [0.0, 3e-3, 4e-3]}
    later = touch_lines(np.random.default_rng(seed), 36, 2e-4, elsewhere)
    found = calibrate(touch_cell(), recorded(touch_cell(), lines[:18] + later[18:]))
    (finding,) = (each for each in found.findings if each.code in ("base-moved", "outlier-samples"))
    size_mm = float(re.search(r"mark_b (?:had been )?(?:moved|elsewhere) by ([0-9.]+)", finding.message)[1])
    assert size_mm == pytest.approx(5.0, abs=0.5)
    assert "sample 20" in finding.message


@pytest.mark.journey
def test_bent_tip_is_named(monkeypatch):
    """A tip bent by 5 mm at half time is named from its first touch after that on, without a rotation."""
    lines = touch_lines(np.random.default_rng(3), 36, 2e-4)
    monkeypatch.setitem(TIPS, "hand", TIPS["hand"] + [3e-3, 4e-3, 0.0])
    later = touch_lines(np.random.default_rng(3), 36, 2e-4)
    found = calibrate(touch_cell(), recorded(touch_cell(), lines[:18] + later[18:]))
    (finding,) = (each for each in found.findings if each.code == "base-moved")
    assert finding.about[0] == "hand_flange_from_hand_tip"
    assert re.search(r"hand_tip moved by [45]\.[0-9]+ ± 0\.[0-9]+ mm at about sample 19", finding.what)
