"""Points seen one by one: what is said of them alike in pixels and in 3-D."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.seen_points import point_jacobians
from basecal.geometry import SE3, Camera

LENS = Camera("pinhole", [500.0, 510.0, 320.0, 240.0])
BENT_LENS = Camera("pinhole", [500.0, 510.0, 320.0, 240.0, -0.1, 0.05, 1e-3, 0.0, 0.0])
SEEN = np.array([[True, True, True, True], [True, False, True, True]])
STATED = SEEN * np.array([4.0, 0.0, 2.0, 0.0])
AT = SE3.from_rotvec([[0.1, 0.0, 0.2], [0.0, -0.3, 0.1]], [[0.0, 0.1, 2.0], [0.1, 0.0, 3.0]])


@pytest.fixture(params=["pixel_px", "point_m"])
def measurement(request, rng):
    """Two views of four points, off by random numbers, of which one was not seen and two state a sigma."""
    points, weight = 0.3 * rng.normal(size=(4, 3)), np.where(SEEN, np.where(STATED > 0, STATED, 3.0), 0.0)
    in_camera = AT.rotation[:, None] @ points[..., None]
    in_camera = in_camera[..., 0] + AT.translation[:, None]
    kind, exact = (
        (PixelMeasurement, LENS.project(in_camera)) if request.param == "pixel_px" else (PointMeasurement, in_camera)
    )
    return kind(points, exact + rng.normal(size=exact.shape), SEEN, STATED, weight)


def test_derivatives_are_those_of_the_residuals(measurement):
    """By the place of a point, by differences; residuals are the same as those of poses."""
    places = measurement.camera_points(AT)
    off, by_point, by_lens = measurement.with_derivatives(places, LENS, False)
    np.testing.assert_allclose(off, measurement.residuals(AT, LENS), atol=1e-9)
    assert by_lens is None
    for axis in range(3):
        shift = 1e-6 * np.eye(3)[axis]
        ahead, behind = (measurement.with_derivatives(places + s, LENS, False)[0] for s in (shift, -shift))
        np.testing.assert_allclose(by_point[..., axis], (ahead - behind) / 2e-6, rtol=1e-6, atol=1e-6)


def test_squares_are_of_points_without_a_sigma(measurement):
    """By the sigma in use; what was not seen counts nothing."""
    off = measurement.residuals(AT, LENS)
    expected = sum(9.0 * np.sum(off[v, p] ** 2) for v in range(2) for p in range(4) if SEEN[v, p] and not STATED[v, p])
    assert measurement.squares(AT, LENS) == {measurement.noise_field: pytest.approx(expected)}
    free, all_seen = measurement.coordinates * 3, measurement.coordinates * 7
    assert measurement.counts() == {"stated": all_seen - free, measurement.noise_field: free}


def test_masked_points_were_never_seen(measurement):
    """They state nothing and weigh nothing; where all are kept nothing changes."""
    kept = np.ones((2, 4), dtype=bool)
    assert measurement.mask_points(kept) is measurement
    kept[0, 2] = False
    fewer = measurement.mask_points(kept)
    np.testing.assert_array_equal(fewer.seen, SEEN & kept)
    np.testing.assert_array_equal([fewer.stated, fewer.weight], np.where(kept, [STATED, measurement.weight], 0.0))
    assert fewer.point_counts().tolist() == [3, 3]


def test_what_states_no_sigma_any_more_keeps_its_weight(measurement):
    """Of points in space; pixels keep how they compare, 1 for those that stated none."""
    silent = replace(measurement, stated=STATED).without_sigmas()
    assert not silent.stated.any()
    np.testing.assert_array_equal(silent.weight, measurement.weight)
    if isinstance(silent, PixelMeasurement):
        np.testing.assert_allclose(silent.relative, np.where(STATED > 0, STATED / 3.0, 1.0))


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
    rows, view = point_jacobians(measurement, at, BENT_LENS, lens), measurement.linearise(at, BENT_LENS, lens)
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
    rows = point_jacobians(behind, at, BENT_LENS, False)
    assert not rows.seen.any()
    assert not rows.residual.any()
    assert not rows.jacobian.any()
    ahead = point_jacobians(measurement, at, BENT_LENS, False)
    np.testing.assert_array_equal(ahead.seen, measurement.seen)
    unweighted = replace(measurement, weight=np.where(np.arange(6) == 2, 0.0, measurement.weight))
    np.testing.assert_array_equal(
        point_jacobians(unweighted, at, BENT_LENS, False).seen, measurement.seen & (np.arange(6) != 2)
    )
    assert not ahead.residual[~measurement.seen].any()
