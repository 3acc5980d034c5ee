"""Tests of properties shared by all measurements of a target's points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.target_points import point_jacobians, spread_rows
from basecal.geometry import SE3, Camera

POINTS = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.1, 0.2, 0.05]])


def bearings(views: int) -> BearingMeasurement:
    seen = np.random.default_rng(0).normal(size=(views, len(POINTS), 3))
    return BearingMeasurement(
        POINTS, seen / np.linalg.norm(seen, axis=-1, keepdims=True), np.ones((views, len(POINTS)))
    )


def test_points_are_transformed_by_each_pose():
    """A view's points in the camera are those of the target at its own pose."""
    poses = SE3.exp(np.random.default_rng(1).normal(size=(3, 6)))
    at = bearings(3).camera_points(poses)
    assert all(np.allclose(at[k], poses[k] @ POINTS, rtol=0, atol=1e-14) for k in range(3))


def test_selected_views_share_the_target_points():
    """Rows select the data of views, and the target's points are shared."""
    whole = bearings(4)
    some = whole.take(np.array([2, 0]))
    assert some.points_in_target is whole.points_in_target
    assert np.array_equal(some.bearings_in_camera, whole.bearings_in_camera[[2, 0]])
    assert np.array_equal(some.weight, whole.weight[[2, 0]])


def test_pixels_need_a_lens():
    """Pixels without a lens raise InputError, both for linearisation and for squares."""
    everywhere = np.ones((1, len(POINTS)), dtype=bool)
    pixels = PixelMeasurement(POINTS, np.zeros((1, len(POINTS), 2)), everywhere, 1.0 * everywhere, 1.0 * everywhere)
    with pytest.raises(InputError, match="lens"):
        pixels.linearise(SE3.exp(np.zeros((1, 6))), None, False)
    with pytest.raises(InputError, match="lens"):
        pixels.squares(SE3.exp(np.zeros((1, 6))), None)


@pytest.mark.parametrize(("columns", "rows"), [(11, 15), (7, 16), (28, 17), (5, 5)])
def test_spread_rows_of_a_grid_span_it(columns, rows):
    """At most sixteen points of any grid are selected, each once, and not in one line.

    Every eleventh of 11 x 15 is one column.
    """
    grid = np.array([[x, y, 0.0] for y in range(rows) for x in range(columns)])
    few = spread_rows(grid, 16)
    assert 10 <= len(few) <= 16
    assert np.all(np.diff(few) > 0)
    assert np.all(grid[few].std(0)[:2] >= 0.8 * grid.std(0)[:2])


@pytest.mark.parametrize("away", [0.0, [-10.0, 5.0, 0.0], [10.0, -5.0, 3.0]], ids=str)
def test_spread_rows_start_at_the_outermost_point(away):
    """If regular steps span less, the point farthest from the middle is first, then the farthest from these.

    The target's origin has no effect.
    """
    points = np.array([[0.0, 0.2, 0.0], [-1.75, 0.9, 0.0], [0.05, 0.9, 0.0], [1.7, 0.9, 0.0], [0.0, -2.0, 0.0]]) + away
    assert spread_rows(points, 2).tolist() == [1, 4]


def test_few_points_are_all_kept():
    """Up to the requested number, points are not thinned."""
    np.testing.assert_array_equal(spread_rows(POINTS, 4), np.arange(4))
    assert len(spread_rows(POINTS, 9)) == 4


def test_rotated_and_shifted_points_are_in_the_camera():
    """Rotated points are about the target's origin, and the shift moves them to the camera, with or without a batch."""
    poses = SE3.exp(np.random.default_rng(1).normal(size=(2, 3, 6)))
    whole = bearings(3)
    turned = whole.rotate_points(poses)
    np.testing.assert_allclose(turned, np.moveaxis(POINTS @ poses.rotation.mT, -1, 0), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(whole.translate(poses, turned), whole.camera_points(poses))


SEEN = np.array([[True, True, True], [True, False, True]])
WEIGHT = SEEN * np.array([4.0, 2.0, 1.0])


@pytest.fixture(params=["bearings", "pixels", "points"])
def measurement(request, rng):
    """Two views of three points, one of them unseen in the second view."""
    points = rng.normal(size=(3, 3))
    if request.param == "bearings":
        return BearingMeasurement(points, rng.normal(size=(2, 3, 3)), WEIGHT)
    if request.param == "pixels":
        return PixelMeasurement(points, rng.normal(size=(2, 3, 2)), SEEN, 0.5 * WEIGHT, WEIGHT, 0.1, 2.0 * SEEN)
    return PointMeasurement(points, rng.normal(size=(2, 3, 3)), SEEN, 0.5 * WEIGHT, WEIGHT)


def test_weights_are_scaled_and_masked(measurement):
    """Sigmas are twice as large, and one point is marked as unseen."""
    np.testing.assert_array_equal(measurement.noisier(2.0).weight, WEIGHT / 2)
    kept = np.array([[True, True, False], [True, True, True]])
    fewer = measurement.mask_points(kept)
    np.testing.assert_array_equal(fewer.weight, np.where(kept, WEIGHT, 0.0))
    assert fewer.point_counts().tolist() == [2, 2]


def test_points_are_counted_up_to_six_freedoms(measurement):
    """Each point counts by its coordinates, six at most."""
    assert measurement.point_counts().tolist() == [3, 2]
    assert measurement.equations().tolist() == [min(6, count * measurement.coordinates) for count in (3, 2)]


def test_only_arrays_with_a_batch_axis_are_selected(measurement):
    """Data shared by all entries of a batch are kept."""
    assert set(measurement.axes) <= set(vars(measurement))
    (name,) = set(measurement.axes) - {"seen", "stated", "weight", "relative"}
    several = np.stack([getattr(measurement, name) + shift for shift in range(4)])
    taken = replace(measurement, **{name: several}).take_batch(np.array([3, 1]))
    np.testing.assert_array_equal(getattr(taken, name), several[[3, 1]])
    assert taken.weight is measurement.weight
    heavier = replace(measurement, weight=np.stack([WEIGHT, 2 * WEIGHT])).take_batch(1)
    np.testing.assert_array_equal(heavier.weight, 2 * WEIGHT)
    assert getattr(heavier, name) is getattr(measurement, name)


LENS = Camera("pinhole", [500.0, 510.0, 320.0, 240.0])
BENT_LENS = Camera("pinhole", [500.0, 510.0, 320.0, 240.0, -0.1, 0.05, 1e-3, 0.0, 0.0])
SEEN_OF_FOUR = np.array([[True, True, True, True], [True, False, True, True]])
STATED = SEEN_OF_FOUR * np.array([4.0, 0.0, 2.0, 0.0])
AT = SE3.from_rotvec([[0.1, 0.0, 0.2], [0.0, -0.3, 0.1]], [[0.0, 0.1, 2.0], [0.1, 0.0, 3.0]])


@pytest.fixture(params=["pixel_px", "point_m"])
def seen_points(request, rng):
    """Two views of four points with random errors, one of them unseen and two with stated sigmas."""
    points, weight = 0.3 * rng.normal(size=(4, 3)), np.where(SEEN_OF_FOUR, np.where(STATED > 0, STATED, 3.0), 0.0)
    in_camera = AT.rotation[:, None] @ points[..., None]
    in_camera = in_camera[..., 0] + AT.translation[:, None]
    kind, exact = (
        (PixelMeasurement, LENS.project(in_camera)) if request.param == "pixel_px" else (PointMeasurement, in_camera)
    )
    return kind(points, exact + rng.normal(size=exact.shape), SEEN_OF_FOUR, STATED, weight)


def test_derivatives_equal_those_of_residuals(seen_points):
    """Derivatives by the position of a point equal differences, and residuals equal those of poses."""
    places = seen_points.camera_points(AT)
    off, by_point, by_lens = seen_points.with_derivatives(places, LENS, False)
    np.testing.assert_allclose(off, seen_points.residuals(AT, LENS), atol=1e-9)
    assert by_lens is None
    for axis in range(3):
        shift = 1e-6 * np.eye(3)[axis]
        ahead, behind = (seen_points.with_derivatives(places + s, LENS, False)[0] for s in (shift, -shift))
        np.testing.assert_allclose(by_point[..., axis], (ahead - behind) / 2e-6, rtol=1e-6, atol=1e-6)


def test_squares_are_of_points_without_a_sigma(seen_points):
    """The sigma in use applies, and unseen points do not count."""
    off = seen_points.residuals(AT, LENS)
    expected = sum(
        9.0 * np.sum(off[v, p] ** 2) for v in range(2) for p in range(4) if SEEN_OF_FOUR[v, p] and not STATED[v, p]
    )
    assert seen_points.squares(AT, LENS) == {seen_points.noise_field: pytest.approx(expected)}
    free, all_seen = seen_points.coordinates * 3, seen_points.coordinates * 7
    assert seen_points.counts() == {"stated": all_seen - free, seen_points.noise_field: free}


def test_masked_points_are_unseen(seen_points):
    """Masked points have neither a stated sigma nor a weight. If all are kept, the measurement is unchanged."""
    kept = np.ones((2, 4), dtype=bool)
    assert seen_points.mask_points(kept) is seen_points
    kept[0, 2] = False
    fewer = seen_points.mask_points(kept)
    np.testing.assert_array_equal(fewer.seen, SEEN_OF_FOUR & kept)
    np.testing.assert_array_equal([fewer.stated, fewer.weight], np.where(kept, [STATED, seen_points.weight], 0.0))
    assert fewer.point_counts().tolist() == [3, 3]


def test_without_sigmas_keeps_the_weights(seen_points):
    """Points in space keep their weights. Pixels keep their relative weights, 1 for those without a stated sigma."""
    silent = replace(seen_points, stated=STATED).without_sigmas()
    assert not silent.stated.any()
    np.testing.assert_array_equal(silent.weight, seen_points.weight)
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
def test_points_sum_to_their_view(rng, lens):
    """Squares sum to the cost, J'r to the gradient and J'J to the information, with or without the lens's columns."""
    seen_points, at = pixels(rng), poses(rng, 3)
    rows, view = point_jacobians(seen_points, at, BENT_LENS, lens), seen_points.linearise(at, BENT_LENS, lens)
    np.testing.assert_allclose(np.sum(rows.residual**2, (1, 2)), view.cost)
    gradient = np.einsum("npdk,npd->nk", rows.jacobian, rows.residual)
    np.testing.assert_allclose(gradient, view.gradient, rtol=1e-9, atol=1e-9 * np.abs(view.gradient).max())
    information = np.einsum("npdk,npdl->nkl", rows.jacobian, rows.jacobian)
    np.testing.assert_allclose(information, view.information, rtol=1e-9, atol=1e-9 * np.abs(information).max())


def test_3d_points_sum_to_their_view(rng):
    """The sums hold for points measured in 3-D, which need no lens."""
    points, at = rng.standard_normal((5, 3)), poses(rng, 2)
    weight = rng.uniform(0.5, 2.0, (2, 5)) * (rng.uniform(size=(2, 5)) < 0.8)
    seen_points = PointMeasurement(points, rng.standard_normal((2, 5, 3)), weight > 0, weight, weight)
    rows, view = point_jacobians(seen_points, at, None, False), seen_points.linearise(at, None, False)
    np.testing.assert_allclose(np.sum(rows.residual**2, (1, 2)), view.cost)
    np.testing.assert_allclose(np.einsum("npdk,npd->nk", rows.jacobian, rows.residual), view.gradient, atol=1e-9)
    np.testing.assert_allclose(np.einsum("npdk,npdl->nkl", rows.jacobian, rows.jacobian), view.information, atol=1e-9)


def test_unseen_points_have_no_effect(rng):
    """Points without weight, and those behind the camera, have no residual and no derivative.

    They are marked as unseen.
    """
    seen_points, at = pixels(rng), poses(rng, 3)
    behind = replace(seen_points, points_in_target=seen_points.points_in_target - np.array([0, 0, 9.0]))
    rows = point_jacobians(behind, at, BENT_LENS, False)
    assert not rows.seen.any()
    assert not rows.residual.any()
    assert not rows.jacobian.any()
    ahead = point_jacobians(seen_points, at, BENT_LENS, False)
    np.testing.assert_array_equal(ahead.seen, seen_points.seen)
    unweighted = replace(seen_points, weight=np.where(np.arange(6) == 2, 0.0, seen_points.weight))
    np.testing.assert_array_equal(
        point_jacobians(unweighted, at, BENT_LENS, False).seen, seen_points.seen & (np.arange(6) != 2)
    )
    assert not ahead.residual[~seen_points.seen].any()
