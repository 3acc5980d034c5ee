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


def test_as_a_program_that_drives_them_has_it():
    """Both ways, X, Y, Z [mm] and Rx, Ry, Rz [deg], with the matrix that `Staubli_2_Pose` of RoboDK 6.0.2 gives."""
    told = [100.0, -200.0, 300.0, 25.0, -40.0, 110.0]
    matrix = [
        [-0.26200263, -0.71984631, -0.64278761],
        [0.944561805, -0.054704465, -0.323744371],
        [0.197882839, -0.691974502, 0.694272044],
    ]
    read = CONVENTION.read(np.array(told))
    np.testing.assert_allclose(read.rotation, matrix, atol=1e-9)
    np.testing.assert_allclose(read.translation, [0.1, -0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(CONVENTION.to_numbers(read), told, atol=1e-9)
