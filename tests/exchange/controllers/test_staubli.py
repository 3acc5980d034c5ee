"""Stäubli."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from basecal.exchange.controllers.staubli import CONVENTION


def test_about_x_then_the_new_y_then_the_new_z():
    """In degrees and mm."""
    read = CONVENTION.read(np.array([100, 0, 0, 10, 20, 30]))
    np.testing.assert_allclose(
        read.rotation, Rotation.from_euler("XYZ", [10, 20, 30], degrees=True).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(read.translation, [0.1, 0, 0])
