"""Tests of numbers and poses as plain data."""

from __future__ import annotations

import json

import numpy as np

from basecal.cell.format.plain import numbers, one_or_all, pose_dict, sigma_dict
from basecal.geometry import SE3


def test_numbers_are_nested_lists_without_negative_zeros():
    """Integers become floats, and zeros lose their sign."""
    assert json.dumps(numbers(np.array([[-0.0, 1], [2, -3]]))) == "[[0.0, 1.0], [2.0, -3.0]]"


def test_pose_round_trip(rng):
    """The translation is kept exactly, the rotation to fifteen digits; 0.5 is written as by hand."""
    pose = SE3.exp(rng.normal(size=6))
    found = pose_dict(pose)
    assert found["t_m"] == pose.translation.tolist()
    np.testing.assert_allclose(SE3.from_quaternion(found["q_xyzw"], found["t_m"]).matrix, pose.matrix, atol=1e-14)
    assert pose_dict(SE3.from_rpy([0, 0, np.pi / 3], [0, 0, 0]))["q_xyzw"][2:] == [0.5, round(np.sqrt(0.75), 15)]


def test_equal_sigmas_become_one_number():
    """Equal sigmas are written as one number; different ones, and an empty array, as a list."""
    assert one_or_all(np.array([2.0, 2.0])) == 2.0
    assert one_or_all(np.array([2.0, 3.0])) == [2.0, 3.0]
    assert one_or_all(np.zeros(0)) == []
    assert sigma_dict(np.array([1.0, 1.0, 1.0, 1.0, 2.0, 3.0])) == {"sigma_t_m": 1.0, "sigma_r_rad": [1.0, 2.0, 3.0]}
