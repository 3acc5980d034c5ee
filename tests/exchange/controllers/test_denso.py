"""DENSO."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from basecal.exchange.controllers.denso import CONVENTION


def test_about_fixed_x_y_z():
    """In degrees and mm."""
    read = CONVENTION.read(np.array([100, 0, 0, 10, 20, 30]))
    expected = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
    np.testing.assert_allclose(read.rotation, expected, atol=1e-14)
    np.testing.assert_allclose(read.translation, [0.1, 0, 0])


def test_rz_is_where_the_base_x_goes_about_z():
    """As its manual says: with RZ alone, the flange's x is the base's x turned about z by RZ."""
    x = CONVENTION.read(np.array([0, 0, 0, 0, 0, 30])).rotation[:, 0]
    np.testing.assert_allclose(x, [np.cos(np.pi / 6), 0.5, 0], atol=1e-15)
