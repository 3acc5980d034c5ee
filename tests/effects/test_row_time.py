"""Tests of a rolling shutter: rows that are exposed later show a moving target at a later pose."""

from __future__ import annotations

import numpy as np

from basecal.effects.row_time import row_shift
from basecal.geometry import SE3, Camera

LENS = Camera("pinhole", np.array([900.0, 910.0, 640.0, 360.0]), None)
POINTS = np.array([[0.0, 0.0, 0.0], [0.1, -0.05, 0.0]])
AFTER_S = np.array([0.0, 2e-3])


def test_pixels_shift_by_row_delay():
    """A point at 2 m shifts by f v t / z, and not at the instant of the mean row."""
    pose = SE3.from_rpy((0.0, 0.0, 0.0), (0.1, 0.0, 2.0))
    shift = row_shift(LENS, pose, np.array([0.5, -1.0, 0.0, 0.0, 0.0, 0.0]), POINTS, AFTER_S)
    np.testing.assert_allclose(shift, [[0, 0], [900 * 0.5 * 1e-3, -910 * 1e-3]], atol=1e-12)


def test_points_behind_camera_are_not_shifted():
    """Points behind the camera have no pixel before or after the delay."""
    behind = SE3.from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, -2.0))
    assert np.all(row_shift(LENS, behind, np.ones(6), POINTS, AFTER_S) == 0)
