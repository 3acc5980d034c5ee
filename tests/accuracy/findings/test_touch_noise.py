"""`touch-noise`: touches that scatter more than stated."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import MARKS, recorded, touch_cell, touch_lines

from basecal.accuracy.calibrate import calibrate


@pytest.mark.parametrize(("scatter_m", "codes", "verdict"), [(3e-4, {"touch-noise"}, "good"), (1e-4, set(), "good")])
def test_a_small_stated_sigma_is_named(scatter_m, codes, verdict):
    """It is no poor fit: the answer is good, by the noise that the touches show, which is in the message."""
    lines = touch_lines(np.random.default_rng(0), 24, scatter_m, MARKS, True)
    for line in lines:
        line["observations"][0]["sigma_m"] = 1e-4
    found = calibrate(touch_cell(), recorded(touch_cell(), lines))
    assert found.verdict == verdict
    assert {each.code for each in found.findings} == codes
    assert {each.about for each in found.findings} <= {("eye_tip",), ("hand_tip",)}
    assert all("0.1 mm is stated" in each.what and "sigma_m: 0.000" in each.do[0] for each in found.findings)


def test_a_small_stated_sigma_is_named_beside_an_arm_of_unknown_noise():
    """The arm's noise makes up for it: both are named, the answer is good, and no convention is doubted."""
    lines = touch_lines(np.random.default_rng(0), 36, 2e-4, MARKS, True)
    for line in lines:
        line["observations"][0]["sigma_m"] = 2e-5
    cell = touch_cell(robots={"eye": {}, "hand": {}})
    found = calibrate(cell, recorded(cell, lines))
    named = [each for each in found.findings if each.code == "touch-noise"]
    assert found.verdict == "good"
    assert {each.about for each in named} == {("eye_tip",), ("hand_tip",)}
    assert all("of the touches or of the arm" in each.why for each in named)
    assert "poor-fit" not in {each.code for each in found.findings}


def test_scatter_that_no_touch_has_is_a_poor_fit():
    """Above 3 mm something else is wrong."""
    lines = touch_lines(np.random.default_rng(0), 24, 6e-3, MARKS, True)
    for line in lines:
        line["observations"][0]["sigma_m"] = 1e-3
    found = calibrate(touch_cell(), recorded(touch_cell(), lines))
    assert "poor-fit" in {each.code for each in found.findings}
    assert found.verdict == "doubtful"
