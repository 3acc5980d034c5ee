"""Tests of measured poses: sigmas, counts and views."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.view.measurement import Noise
from basecal.estimation.view.pose_errors import CornerErrors
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3

STATED = np.array([[4.0] * 6, [0.0] * 6, [0.0, 0.0, 0.0, 8.0, 8.0, 8.0]])


@pytest.fixture
def measurement():
    return PoseMeasurement(SE3.identity((3,)), STATED, np.where(STATED > 0, STATED, 1.0))


def test_unstated_sigma_is_that_of_the_noise(measurement):
    """Translations and rotations have separate sigmas, and stated ones are kept."""
    weight = measurement.with_noise(Noise(pose_m=0.5, pose_rad=0.1)).weight
    np.testing.assert_allclose(weight, [[4] * 6, [2, 2, 2, 10, 10, 10], [2, 2, 2, 8, 8, 8]])


def test_counts_and_equations_of_poses(measurement):
    """A pose has six residuals, counted by their sigma, and all six freedoms."""
    assert measurement.counts() == {"stated": 9, "pose_m": 6, "pose_rad": 3}
    assert measurement.equations().tolist() == [6, 6, 6]


def test_squares_are_of_poses_without_a_sigma(measurement):
    """Shifts by 1 m along z and rotations by 0.1 rad about x are counted separately."""
    shifted = SE3.exp(np.tile([0, 0, 1.0, 0, 0, 0], (3, 1)))
    turned = SE3.exp(np.tile([0, 0, 0, 0.1, 0, 0], (3, 1)))
    noisy = measurement.with_noise(Noise(pose_m=0.5, pose_rad=0.1))
    assert noisy.squares(shifted, None) == {"pose_m": pytest.approx(8.0), "pose_rad": pytest.approx(0.0)}
    assert noisy.squares(turned, None) == {"pose_m": pytest.approx(0.0), "pose_rad": pytest.approx(1.0)}


def test_cost_is_the_weighted_square(measurement):
    """The cost is the weighted square of each view, and zero at the measured pose."""
    shifted = SE3.exp(np.tile([1.0, 0, 0, 0, 0, 0], (3, 1)))
    np.testing.assert_allclose(measurement.linearise(shifted, None, False).cost, [16, 1, 1])
    np.testing.assert_array_equal(measurement.linearise(SE3.identity((3,)), None, False).cost, 0.0)


def test_views_are_selected_with_their_data(measurement):
    """Selected views keep all of their data, in the requested order."""
    np.testing.assert_array_equal(measurement.take(np.array([2, 0])).stated, STATED[[2, 0]])
    np.testing.assert_array_equal(measurement.take(np.array([2, 0])).weight, measurement.weight[[2, 0]])


def test_rows_of_a_batch_are_selected():
    """Separate poses are selected by row, and shared ones are kept."""
    ahead = SE3.exp(np.arange(6.0).reshape(2, 3, 1) * np.eye(6)[0])
    stated = 1.0 + np.arange(2 * 3 * 6).reshape(2, 3, 6)
    taken = PoseMeasurement(ahead, stated, 2 * stated).take_batch(np.array([1]))
    np.testing.assert_array_equal(taken.measured_camera_from_target.translation[..., 0], [[3.0, 4.0, 5.0]])
    np.testing.assert_array_equal(taken.stated, stated[[1]])
    np.testing.assert_array_equal(taken.weight, 2 * stated[[1]])
    alike = PoseMeasurement(ahead[0], STATED, STATED).take_batch(np.array([1]))
    np.testing.assert_array_equal(alike.measured_camera_from_target.translation[..., 0], [0.0, 1.0, 2.0])


def test_corner_errors_are_weighted() -> None:
    """Cost, gradient and the smallest rotation information are those of whitened corner differences."""
    rng = np.random.default_rng(3)
    ahead = SE3.from_rotvec([np.pi, 0, 0], [0, 0, 0.5])
    measured, near = (SE3.stack([ahead] * 4) @ SE3.exp(0.1 * rng.normal(size=(4, 6))) for _ in range(2))
    corners, weight = CornerErrors.from_poses(near, 0.04), rng.uniform(1, 2, (4, 6))
    views = PoseMeasurement(measured, np.zeros((4, 6)), weight, corners)
    error = weight * corners.differences(measured, near)
    found = views.linearise(near, None, False)
    np.testing.assert_allclose(found.cost, np.sum(error**2, axis=1))
    step = 1e-6 * np.eye(6)[3]
    moved = (
        views.linearise(near @ SE3.exp(step), None, False).cost
        - views.linearise(near @ SE3.exp(-step), None, False).cost
    )
    np.testing.assert_allclose(found.gradient[:, 3], moved / 4e-6, rtol=1e-5)
    np.testing.assert_allclose(sum(views.squares(near, None).values()), np.sum(error**2))
    plain = PoseMeasurement(measured, np.zeros((4, 6)), weight)
    np.testing.assert_array_equal(plain.least_rotation_weight(), weight[:, 3:].min(1))
    of_rotation = corners.jacobian(measured)[:, 3:, 3:]
    assert np.all(views.least_rotation_weight() <= np.linalg.norm(of_rotation, axis=(1, 2)) * weight[:, 3:].min(1))
