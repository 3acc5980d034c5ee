"""Tests of directions to a target's points: chord cost, weights, views and batches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.measurement import Noise
from basecal.geometry import SE3

POINTS = np.array([[0.0, 0.0, 2.0], [2.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, -1.0]])
UNIT = np.array([[0, 0, 1.0], [1, 0, 0], [0, -1, 0], [0, 0, -1]])
WEIGHT = np.array([[1.0, 2.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0]])


@pytest.fixture
def measurement():
    """The first view sees the second point at a right angle to its direction; all others are exact."""
    bearings = np.stack([UNIT, UNIT])
    bearings[0, 1] = [0, 1, 0]
    return BearingMeasurement(POINTS, bearings, WEIGHT)


def test_cost_is_the_weighted_chord(measurement):
    """Unit vectors at a right angle are sqrt(2) apart, and a point seen behind the camera costs nothing there."""
    view = measurement.linearise(SE3.identity((2,)), None, False)
    np.testing.assert_allclose(view.cost, [2.0 * 2.0**2, 0.0], atol=1e-12)


def test_distance_along_the_direction_is_unobservable():
    """The direction of a single point determines two of three shifts, and the third has no information."""
    one = BearingMeasurement(np.array([[0.0, 0.0, 0.0]]), np.array([[[0.0, 0.6, 0.8]]]), np.array([[5.0]]))
    view = one.linearise(SE3(np.eye(3)[None], np.array([[0.0, 1.2, 1.6]])), None, False)
    np.testing.assert_allclose(view.information[0, :3, :3] @ [0, 0.6, 0.8], 0.0, atol=1e-12)
    np.testing.assert_allclose(view.information[0, 0, 0], (5.0 / 2.0) ** 2)
    np.testing.assert_array_equal(view.information[0, 3:], 0.0)


def test_direction_is_defined_near_the_camera_centre():
    """Some billionths of a millimetre before the camera the point has a direction, and in its exact centre none."""
    one = BearingMeasurement(np.zeros((1, 3)), np.array([[[0.0, 0.6, 0.8]]]), np.array([[5.0]]))
    at = SE3(np.tile(np.eye(3), (2, 1, 1)), np.array([[0.0, 0.6, 0.8], [0, 0, 0]]) * 2e-12)
    np.testing.assert_allclose(one.take([0, 0]).linearise(at, None, False).cost, [0.0, 25.0], atol=1e-9)


def test_weights_of_directions_are_fixed(measurement):
    """Estimated noise does not change them, and none of their residuals needs an estimate."""
    assert measurement.with_noise(Noise(pixel_px=7.0)) is measurement
    assert measurement.squares(SE3.identity((2,)), None) == {}
    assert measurement.counts() == {"stated": 2 * 6}


def test_equations_are_two_for_each_direction_up_to_six(measurement):
    """Two directions determine four freedoms, four determine all six."""
    assert measurement.equations().tolist() == [4, 6]


def test_views_are_selected_in_the_requested_order(measurement):
    """Bearings are selected with their weights."""
    taken = measurement.take(np.array([1, 0]))
    np.testing.assert_array_equal(taken.bearings_in_camera, measurement.bearings_in_camera[[1, 0]])
    np.testing.assert_array_equal(taken.weight, WEIGHT[[1, 0]])


def test_rows_of_a_batch_are_selected(measurement):
    """Data shared by all entries are kept, and separate data are selected by row."""
    assert measurement.take_batch(np.array([1])).bearings_in_camera.shape == (2, 4, 3)
    own = replace(
        measurement,
        bearings_in_camera=np.stack([measurement.bearings_in_camera, 2 * measurement.bearings_in_camera]),
        weight=np.stack([WEIGHT, 3 * WEIGHT]),
    ).take_batch(np.array([1]))
    np.testing.assert_array_equal(own.bearings_in_camera, 2 * measurement.bearings_in_camera[None])
    np.testing.assert_array_equal(own.weight, 3 * WEIGHT[None])
