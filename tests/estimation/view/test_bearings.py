"""Directions to a target's points: chords, weights of their own, views and batches."""

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
    """The first view sees the second point at a right angle to where it is; the others are seen where they are."""
    bearings = np.stack([UNIT, UNIT])
    bearings[0, 1] = [0, 1, 0]
    return BearingMeasurement(POINTS, bearings, WEIGHT)


def test_cost_is_the_weighted_chord(measurement):
    """Unit vectors at a right angle are sqrt(2) apart, and what is seen behind the camera costs nothing there."""
    view = measurement.linearise(SE3.identity((2,)), None, False)
    np.testing.assert_allclose(view.cost, [2.0 * 2.0**2, 0.0], atol=1e-12)


def test_distance_along_the_direction_is_not_seen():
    """A single point: its direction tells two of three shifts, the third has no information."""
    one = BearingMeasurement(np.array([[0.0, 0.0, 0.0]]), np.array([[[0.0, 0.6, 0.8]]]), np.array([[5.0]]))
    view = one.linearise(SE3(np.eye(3)[None], np.array([[0.0, 1.2, 1.6]])), None, False)
    np.testing.assert_allclose(view.information[0, :3, :3] @ [0, 0.6, 0.8], 0.0, atol=1e-12)
    np.testing.assert_allclose(view.information[0, 0, 0], (5.0 / 2.0) ** 2)
    np.testing.assert_array_equal(view.information[0, 3:], 0.0)


def test_a_point_has_a_direction_down_to_the_camera_itself():
    """Some billionths of a millimetre before it the point is seen where it is; in its very centre it is nowhere."""
    one = BearingMeasurement(np.zeros((1, 3)), np.array([[[0.0, 0.6, 0.8]]]), np.array([[5.0]]))
    at = SE3(np.tile(np.eye(3), (2, 1, 1)), np.array([[0.0, 0.6, 0.8], [0, 0, 0]]) * 2e-12)
    np.testing.assert_allclose(one.take([0, 0]).linearise(at, None, False).cost, [0.0, 25.0], atol=1e-9)


def test_weights_are_its_own(measurement):
    """No noise that is estimated changes them, and none of its residuals asks for one."""
    assert measurement.with_noise(Noise(pixel_px=7.0)) is measurement
    assert measurement.squares(SE3.identity((2,)), None) == {}
    assert measurement.counts() == {"stated": 2 * 6}


def test_equations_are_two_a_direction_and_six_at_most(measurement):
    """Two directions hold four freedoms, four hold all six."""
    assert measurement.equations().tolist() == [4, 6]


def test_views_are_taken_in_the_order_asked_for(measurement):
    """Bearings with their weights."""
    taken = measurement.take(np.array([1, 0]))
    np.testing.assert_array_equal(taken.bearings_in_camera, measurement.bearings_in_camera[[1, 0]])
    np.testing.assert_array_equal(taken.weight, WEIGHT[[1, 0]])


def test_rows_of_a_batch(measurement):
    """What all entries saw is shared; what each saw for itself is taken by row."""
    assert measurement.take_batch(np.array([1])).bearings_in_camera.shape == (2, 4, 3)
    own = replace(
        measurement,
        bearings_in_camera=np.stack([measurement.bearings_in_camera, 2 * measurement.bearings_in_camera]),
        weight=np.stack([WEIGHT, 3 * WEIGHT]),
    ).take_batch(np.array([1]))
    np.testing.assert_array_equal(own.bearings_in_camera, 2 * measurement.bearings_in_camera[None])
    np.testing.assert_array_equal(own.weight, 3 * WEIGHT[None])
