"""Measured points: weights and arrays of a batch, alike for all kinds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement

SEEN = np.array([[True, True, True], [True, False, True]])
WEIGHT = SEEN * np.array([4.0, 2.0, 1.0])


@pytest.fixture(params=["bearings", "pixels", "points"])
def measurement(request, rng):
    """Two views of three points, of which one was not seen."""
    points = rng.normal(size=(3, 3))
    if request.param == "bearings":
        return BearingMeasurement(points, rng.normal(size=(2, 3, 3)), WEIGHT)
    if request.param == "pixels":
        return PixelMeasurement(points, rng.normal(size=(2, 3, 2)), SEEN, 0.5 * WEIGHT, WEIGHT, 0.1, 2.0 * SEEN)
    return PointMeasurement(points, rng.normal(size=(2, 3, 3)), SEEN, 0.5 * WEIGHT, WEIGHT)


def test_weights_are_scaled_and_masked(measurement):
    """Sigmas twice as large, and one point as if it had not been seen."""
    np.testing.assert_array_equal(measurement.noisier(2.0).weight, WEIGHT / 2)
    kept = np.array([[True, True, False], [True, True, True]])
    fewer = measurement.mask_points(kept)
    np.testing.assert_array_equal(fewer.weight, np.where(kept, WEIGHT, 0.0))
    assert fewer.point_counts().tolist() == [2, 2]


def test_points_are_counted_and_hold_as_many_freedoms_as_a_pose_has(measurement):
    """Each by its coordinates, six at most."""
    assert measurement.point_counts().tolist() == [3, 2]
    assert measurement.equations().tolist() == [min(6, count * measurement.coordinates) for count in (3, 2)]


def test_only_arrays_with_a_batch_axis_are_taken_apart(measurement):
    """What all entries of a batch saw alike stays as it is."""
    assert set(measurement.axes) <= set(vars(measurement))
    (name,) = set(measurement.axes) - {"seen", "stated", "weight", "relative"}
    several = np.stack([getattr(measurement, name) + shift for shift in range(4)])
    taken = replace(measurement, **{name: several}).take_batch(np.array([3, 1]))
    np.testing.assert_array_equal(getattr(taken, name), several[[3, 1]])
    assert taken.weight is measurement.weight
    heavier = replace(measurement, weight=np.stack([WEIGHT, 2 * WEIGHT])).take_batch(1)
    np.testing.assert_array_equal(heavier.weight, 2 * WEIGHT)
    assert getattr(heavier, name) is getattr(measurement, name)
