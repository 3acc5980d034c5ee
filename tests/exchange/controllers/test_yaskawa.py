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


def test_as_a_program_that_drives_them_has_it():
    """Both ways, X, Y, Z [mm] and Rx, Ry, Rz [deg], with the matrix that `Motoman_2_Pose` of RoboDK 6.0.2 gives."""
    told = [100.0, -200.0, 300.0, 25.0, -40.0, 110.0]
    matrix = [
        [-0.26200263, -0.758739674, 0.596379685],
        [0.71984631, -0.565246574, -0.402886585],
        [0.64278761, 0.323744371, 0.694272044],
    ]
    read = CONVENTION.read(np.array(told))
    np.testing.assert_allclose(read.rotation, matrix, atol=1e-9)
    np.testing.assert_allclose(read.translation, [0.1, -0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(CONVENTION.to_numbers(read), told, atol=1e-9)
