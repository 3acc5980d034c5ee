"""Tests of round trips of Euler angles, near singular angles as well."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.geometry import SE3
from basecal.geometry.euler import rpy_of_rotation, zyz_of_rotation
from basecal.geometry.rotation import rotation_exp

NEAR = [0.0, 1e-12, 1e-9, 1e-8, 1e-7, 1e-4, 0.1, 1.0]
DRAWN = Rotation.from_quat(np.random.default_rng(0).normal(size=(200, 4))).as_matrix()
LOCKED = [
    np.stack([np.full(len(NEAR), 0.7), sign * (quarter - np.array(NEAR)), np.full(len(NEAR), -1.9)], -1)
    for quarter in (0.0, np.pi / 2, np.pi)
    for sign in (1, -1)
]


def rotate_about_axes(axes: str, angles):
    """Rotations by angles about rotating axes, multiplied from left to right."""
    whole = np.eye(3)
    for axis, angle in zip(axes, np.moveaxis(angles, -1, 0), strict=True):
        whole = whole @ rotation_exp(angle[..., None] * np.eye(3)["xyz".index(axis)])
    return whole


@pytest.mark.parametrize("rotations", [DRAWN, *(rotate_about_axes("zyx", angles) for angles in LOCKED)])
def test_rpy_round_trip(rotations):
    """Roll, pitch and yaw reproduce the rotation to 1e-14, at and near gimbal lock, too."""
    np.testing.assert_allclose(
        SE3.from_rpy(rpy_of_rotation(rotations), 0 * rotations[..., 0]).rotation, rotations, atol=1e-14
    )


@pytest.mark.parametrize("rotations", [DRAWN, *(rotate_about_axes("zyz", angles) for angles in LOCKED)])
def test_zyz_round_trip(rotations):
    """The angles reproduce the rotation to 1e-14, at and near the singular angles 0 and 180 deg, too."""
    angles = zyz_of_rotation(rotations)
    np.testing.assert_allclose(rotate_about_axes("zyz", angles), rotations, atol=1e-14)
    assert np.all((angles[..., 1] >= 0) & (angles[..., 1] <= np.pi))


def test_angles_equal_scipy():
    """Angles equal SciPy's away from singular angles."""
    drawn = Rotation.from_matrix(DRAWN)
    np.testing.assert_allclose(rpy_of_rotation(DRAWN), drawn.as_euler("xyz"), atol=1e-9)
    np.testing.assert_allclose(zyz_of_rotation(DRAWN), drawn.as_euler("ZYZ"), atol=1e-9)
