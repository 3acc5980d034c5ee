"""UFACTORY xArm."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from basecal.exchange.controllers.xarm import CONVENTION


def test_roll_pitch_yaw_about_fixed_axes():
    """In degrees and mm."""
    read = CONVENTION.read(np.array([100, 0, 0, 180, 20, 30]))
    np.testing.assert_allclose(
        read.rotation, Rotation.from_euler("xyz", [180, 20, 30], degrees=True).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(read.translation, [0.1, 0, 0])
