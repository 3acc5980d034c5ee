"""Tests of target points measured in 3-D: sigmas, counts and views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.view.measurement import Noise
from basecal.estimation.view.points import PointMeasurement, is_touch
from basecal.geometry import SE3

SEEN = np.array([[True, True, True, True], [True, False, False, True], [False, False, True, False]])
STATED = SEEN * np.array([4.0, 0.0, 0.0, 0.0])


@pytest.fixture
def measurement(rng):
    points = rng.normal(size=(4, 3))
    return PointMeasurement(points, points + np.array([0.0, 0.0, 0.5]) * SEEN[..., None], SEEN, STATED, 1.0 * SEEN)


def test_unstated_sigma_is_that_of_the_noise(measurement):
    """Stated sigmas are kept, and unseen points have no weight."""
    weight = measurement.with_noise(Noise(point_m=0.5)).weight
    np.testing.assert_array_equal(weight, [[4, 2, 2, 2], [4, 0, 0, 2], [0, 0, 2, 0]])


def test_counts_and_equations_of_points(measurement):
    """A point has three residuals, those with a sigma are counted separately, and a view has six freedoms at most."""
    assert measurement.counts() == {"stated": 6, "point_m": 15}
    assert measurement.equations().tolist() == [6, 6, 3]


def test_squares_are_of_points_without_a_sigma(measurement):
    """Each point is 0.5 m off: at a sigma of 0.5 m its square is one, and stated ones do not count."""
    squares = measurement.with_noise(Noise(point_m=0.5)).squares(SE3.identity((3,)), None)
    assert squares == {"point_m": pytest.approx(5.0)}


def test_cost_is_the_weighted_square(measurement):
    """The cost is the weighted square over all seen points, view by view."""
    view = measurement.with_noise(Noise(point_m=0.5)).linearise(SE3.identity((3,)), None, False)
    np.testing.assert_allclose(view.cost, [4 + 3, 4 + 1, 1])


def test_views_are_selected_with_their_data(measurement):
    """Selected views keep all of their data, in the requested order."""
    taken = measurement.take(np.array([2, 0]))
    np.testing.assert_array_equal(taken.seen, SEEN[[2, 0]])
    np.testing.assert_array_equal(taken.stated, STATED[[2, 0]])
    np.testing.assert_array_equal(taken.points_in_camera, measurement.points_in_camera[[2, 0]])
    np.testing.assert_array_equal(taken.weight, measurement.weight[[2, 0]])


def test_rows_of_a_batch_are_selected(measurement):
    """Data shared by all entries are kept, and separate data are selected by row."""
    rows = np.array([1])
    shared = measurement.take_batch(rows)
    for name in ("points_in_camera", "seen", "stated", "weight"):
        np.testing.assert_array_equal(getattr(shared, name), getattr(measurement, name))
    twice = {
        name: np.stack([of, 2 * of]) for name in ("points_in_camera", "weight") for of in [getattr(measurement, name)]
    }
    own = replace(measurement, **twice).take_batch(rows)
    np.testing.assert_array_equal(own.points_in_camera, 2 * measurement.points_in_camera[None])
    np.testing.assert_array_equal(own.weight, 2 * measurement.weight[None])
    np.testing.assert_array_equal(own.seen, SEEN)
    seen = np.stack([SEEN, ~SEEN])
    masked = replace(measurement, seen=seen, stated=1.0 * seen).take_batch(rows)
    np.testing.assert_array_equal(masked.seen, [~SEEN])
    np.testing.assert_array_equal(masked.stated, [1.0 * ~SEEN])


def test_noisier_points_have_less_weight(measurement):
    """All sigmas, stated or not, are larger by a factor, and the cost is smaller by its square."""
    plain, wide = (m.linearise(SE3.identity((3,)), None, False).cost for m in (measurement, measurement.noisier(2.0)))
    np.testing.assert_allclose(wide, plain / 4)


def test_points_at_the_sensor_origin_are_touches(measurement):
    """A touch has all of its points at the origin of the sensor."""
    assert not is_touch(measurement)
    touched = replace(measurement, points_in_camera=np.zeros_like(measurement.points_in_camera))
    assert is_touch(touched)
    some = touched.points_in_camera.copy()
    some[0, 0, 2] = 1e-3
    assert not is_touch(replace(touched, points_in_camera=some))
    assert not is_touch(None)
