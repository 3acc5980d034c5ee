"""KUKA."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from basecal.exchange.controllers.kuka import CONVENTION


def test_a_turns_about_z_then_b_about_the_new_y_then_c_about_the_new_x():
    """As its manual says, in degrees and mm."""
    read = CONVENTION.read(np.array([100, 0, -20, 30, 40, 50]))
    np.testing.assert_allclose(
        read.rotation, Rotation.from_euler("ZYX", [30, 40, 50], degrees=True).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(read.translation, [0.1, 0, -0.02])


def test_quaternion_of_the_maker_of_a_camera():
    """The formula that Basler gives for A, B, C, written out."""
    a, b, c = np.radians([30, 40, 50]) / 2
    x = np.cos(a) * np.cos(b) * np.sin(c) - np.sin(a) * np.sin(b) * np.cos(c)
    w = np.cos(a) * np.cos(b) * np.cos(c) + np.sin(a) * np.sin(b) * np.sin(c)
    quaternion = CONVENTION.read(np.array([0, 0, 0, 30, 40, 50])).quaternion
    np.testing.assert_allclose(quaternion[[0, 3]], [x, w], atol=1e-14)


def test_as_a_program_that_drives_them_has_it():
    """Both ways, X, Y, Z [mm] and A, B, C [deg], with the matrix that `KUKA_2_Pose` of RoboDK 6.0.2 gives."""
    told = [100.0, -200.0, 300.0, 25.0, -40.0, 110.0]
    matrix = [
        [0.694272044, -0.402886585, 0.596379685],
        [0.323744371, -0.565246574, -0.758739674],
        [0.64278761, 0.71984631, -0.26200263],
    ]
    read = CONVENTION.read(np.array(told))
    np.testing.assert_allclose(read.rotation, matrix, atol=1e-9)
    np.testing.assert_allclose(read.translation, [0.1, -0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(CONVENTION.to_numbers(read), told, atol=1e-9)
