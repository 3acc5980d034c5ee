"""Directions that nothing depends on."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import recorded, touch_cell, touch_lines

from basecal.accuracy.calibrate import calibrate
from basecal.estimation.problem.held_gauges import held_gauges

LINE = {"socket_1": [0.0, 0.0, 0.0], "socket_2": [0.0, 0.05, 0.0]}


def test_the_rotation_about_the_line_is_held():
    """Of a line along y that about y alone; of a plate of three marks nothing."""
    cell = touch_cell((), marks={"plate": {"points_m": LINE}, "wide": {"points_m": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}})
    held = held_gauges(cell, ())
    assert held["eye_base_from_plate"].tolist() == [0, 0, 0, 0, 1, 0]
    assert "eye_base_from_wide" not in held


def test_an_arm_by_a_plate_of_two_sockets():
    """One arm that touches two sockets: good, and the tip and the sockets are where they are."""
    cell = touch_cell((), marks={"plate": {"points_m": LINE}}, robots={"eye": {"noise": NOISE}}, tips=TIP)
    marks = {name: np.array([0.4, 0.1, 0.2]) + at for name, at in LINE.items()}
    lines = [line for line in touch_lines(np.random.default_rng(0), 48, 1e-4, marks) if "eye" in line["robots"]]
    found = calibrate(cell, recorded(cell, lines))
    assert found.verdict == "good"
    assert found["eye_flange_from_eye_tip"].mean.translation == pytest.approx([0.02, -0.01, 0.15], abs=5e-4)


NOISE = {"sigma_t_m": 1e-6, "sigma_r_rad": 1e-6}
TIP = {"eye_tip": {"on": "eye"}}
