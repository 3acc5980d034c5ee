"""Tests of OpenCV's solvers, converted to basecal's frames."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.geometry import SE3, Camera
from basecal.vision.robot_world import METHODS, camera_from_target, robot_world

LENS = Camera("pinhole", np.array([900.0, 905.0, 640.0, 350.0, -0.2, 0.05, 0.001, -0.001, 0.0]), (1280, 720))


def test_camera_from_target_is_exact() -> None:
    """The pose from exact pixels is exact, with the distortion of the lens."""
    points = np.array([[x, y, 0.0] for x in (0, 0.1, 0.2) for y in (0, 0.1)])
    true = SE3.exp([-0.1, 0.05, 0.8, 0.2, -0.3, 0.1])
    seen = np.array([True] * 5 + [False])
    pixels = LENS.project(true @ points)
    pixels[5] = 1e4  # unused
    found = camera_from_target(LENS, points, pixels, seen)
    np.testing.assert_allclose((true.inverse() @ found).log(), 0, atol=1e-6)


def test_pose_of_too_few_points_is_none() -> None:
    """Three points allow several poses, and OpenCV finds none by this method."""
    points = np.eye(3)
    assert camera_from_target(LENS, points, np.zeros((3, 2)), np.array([True, True, False])) is None


def test_robot_world_finds_both_transforms() -> None:
    """Equation `outer == first @ inner @ last` determines both `first` and `last`."""
    rng = np.random.default_rng(0)
    first, last, inner = (SE3.exp(rng.normal(size=s)) for s in (6, 6, (12, 6)))
    found = robot_world(first @ inner @ last, inner)
    np.testing.assert_allclose(found.first.matrix, first.matrix, atol=1e-9)
    np.testing.assert_allclose(found.last.matrix, last.matrix, atol=1e-9)


def test_robot_world_with_too_few_poses_is_none() -> None:
    """OpenCV requires three poses."""
    one = SE3.identity((1,))
    assert robot_world(one, one) is None


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_both_transforms(method: str) -> None:
    """Every method is exact for exact poses. Hand-eye methods compute the second unknown as a mean over the views."""
    rng = np.random.default_rng(1)
    first, last, inner = (SE3.exp(0.6 * rng.normal(size=s)) for s in (6, 6, (12, 6)))
    found = robot_world(first @ inner @ last, inner, method)
    assert found is not None
    np.testing.assert_allclose(found.first.matrix, first.matrix, atol=1e-5)
    np.testing.assert_allclose(found.last.matrix, last.matrix, atol=1e-5)
