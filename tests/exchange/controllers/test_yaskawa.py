"""Yaskawa."""

from __future__ import annotations

import numpy as np

from basecal.exchange.controllers.yaskawa import CONVENTION


def test_quaternion_of_the_maker_of_a_camera():
    """The formula that Basler gives for Rx, Ry, Rz, written out; lengths in mm."""
    x, y, z = np.radians([10, -20, 30]) / 2
    qz = np.sin(z) * np.cos(y) * np.cos(x) - np.cos(z) * np.sin(y) * np.sin(x)
    qw = np.cos(z) * np.cos(y) * np.cos(x) + np.sin(z) * np.sin(y) * np.sin(x)
    read = CONVENTION.read(np.array([0, 1000, 0, 10, -20, 30]))
    np.testing.assert_allclose(read.quaternion[2:], [qz, qw], atol=1e-14)
    np.testing.assert_allclose(read.translation, [0, 1, 0])
