"""Points one by one sum up to what their view says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.point_jacobians import point_jacobians
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import SE3, Camera

LENS = Camera("pinhole", [500.0, 510.0, 320.0, 240.0, -0.1, 0.05, 1e-3, 0.0, 0.0])


def poses(rng, n):
    away = SE3.exp(0.2 * rng.standard_normal((n, 6)))
    return SE3(away.rotation, away.translation + np.array([0, 0, 1.5]))


def pixels(rng, n=3, p=6):
    points = 0.2 * rng.standard_normal((p, 3))
    weight = rng.uniform(0.5, 2.0, (n, p)) * (rng.uniform(size=(n, p)) < 0.8)
    return PixelMeasurement(points, 300 + 20 * rng.standard_normal((n, p, 2)), weight > 0, weight, weight)


@pytest.mark.parametrize("lens", [False, True])
def test_points_sum_up_to_their_view(rng, lens):
    """Squares to the cost, J'r to the gradient and J'J to the information, with the lens's columns or without."""
    measurement, at = pixels(rng), poses(rng, 3)
    rows, view = point_jacobians(measurement, at, LENS, lens), measurement.linearise(at, LENS, lens)
    np.testing.assert_allclose(np.sum(rows.residual**2, (1, 2)), view.cost)
    gradient = np.einsum("npdk,npd->nk", rows.jacobian, rows.residual)
    np.testing.assert_allclose(gradient, view.gradient, rtol=1e-9, atol=1e-9 * np.abs(view.gradient).max())
    information = np.einsum("npdk,npdl->nkl", rows.jacobian, rows.jacobian)
    np.testing.assert_allclose(information, view.information, rtol=1e-9, atol=1e-9 * np.abs(information).max())


def test_3d_points_sum_up_to_their_view(rng):
    """The same for points measured in 3-D, which need no lens."""
    points, at = rng.standard_normal((5, 3)), poses(rng, 2)
    weight = rng.uniform(0.5, 2.0, (2, 5)) * (rng.uniform(size=(2, 5)) < 0.8)
    measurement = PointMeasurement(points, rng.standard_normal((2, 5, 3)), weight > 0, weight, weight)
    rows, view = point_jacobians(measurement, at, None, False), measurement.linearise(at, None, False)
    np.testing.assert_allclose(np.sum(rows.residual**2, (1, 2)), view.cost)
    np.testing.assert_allclose(np.einsum("npdk,npd->nk", rows.jacobian, rows.residual), view.gradient, atol=1e-9)
    np.testing.assert_allclose(np.einsum("npdk,npdl->nkl", rows.jacobian, rows.jacobian), view.information, atol=1e-9)


def test_points_not_seen_say_nothing(rng):
    """Neither those without weight nor those behind the camera: no residual, no derivative, and they are told."""
    measurement, at = pixels(rng), poses(rng, 3)
    behind = replace(measurement, points_in_target=measurement.points_in_target - np.array([0, 0, 9.0]))
    rows = point_jacobians(behind, at, LENS, False)
    assert not rows.seen.any()
    assert not rows.residual.any()
    assert not rows.jacobian.any()
    ahead = point_jacobians(measurement, at, LENS, False)
    np.testing.assert_array_equal(ahead.seen, measurement.seen)
    unweighted = replace(measurement, weight=np.where(np.arange(6) == 2, 0.0, measurement.weight))
    np.testing.assert_array_equal(
        point_jacobians(unweighted, at, LENS, False).seen, measurement.seen & (np.arange(6) != 2)
    )
    assert not ahead.residual[~measurement.seen].any()
