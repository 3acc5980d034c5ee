"""FANUC."""

from __future__ import annotations

import numpy as np

from basecal.exchange.controllers.fanuc import CONVENTION


def test_quaternion_of_the_maker_of_a_camera():
    """The formula that Roboception gives for W, P, R, written out; lengths in mm."""
    w, p, r = np.radians([10, -20, 30]) / 2
    x = np.cos(r) * np.cos(p) * np.sin(w) - np.sin(r) * np.sin(p) * np.cos(w)
    y = np.cos(r) * np.sin(p) * np.cos(w) + np.sin(r) * np.cos(p) * np.sin(w)
    read = CONVENTION.read(np.array([1000, 0, 0, 10, -20, 30]))
    np.testing.assert_allclose(read.quaternion[:2], [x, y], atol=1e-14)
    np.testing.assert_allclose(read.translation, [1, 0, 0])
