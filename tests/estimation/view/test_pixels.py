"""Tests of pixels of a target's points: sigmas, counts, thinning, views and batches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.view import pixels
from basecal.estimation.view.measurement import Noise
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.target_points import point_jacobians
from basecal.geometry import SE3, Camera

LENS = Camera("pinhole", [100.0, 100.0, 50.0, 40.0])
POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 0, 0]])
SEEN = np.array(
    [[True, True, True, True, False], [True, False, False, True, False], [False, True, False, False, False]]
)
STATED = SEEN * np.array([4.0, 0.0, 0.0, 0.0, 0.0])
AHEAD = SE3(np.broadcast_to(np.eye(3), (3, 3, 3)), np.tile([0.0, 0.0, 2.0], (3, 1)))


@pytest.fixture
def measurement():
    """Every point is seen 3 px beside and 4 px above its projection at `AHEAD`."""
    pixels = np.tile(LENS.project(POINTS + np.array([0, 0, 2.0])) - [3.0, 4.0], (3, 1, 1))
    return PixelMeasurement(POINTS, pixels, SEEN, STATED, np.where(STATED > 0, STATED, 1.0 * SEEN))


def test_unstated_sigma_is_that_of_the_noise(measurement):
    """Stated sigmas are kept, and unseen points have no weight.

    Detector sigmas weight points relative to each other.
    """
    weight = measurement.with_noise(Noise(pixel_px=0.5)).weight
    np.testing.assert_array_equal(weight, [[4, 2, 2, 2, 0], [4, 0, 0, 2, 0], [0, 2, 0, 0, 0]])
    doubled = replace(measurement, relative=np.full(SEEN.shape, 2.0)).with_noise(Noise(pixel_px=0.5)).weight
    np.testing.assert_array_equal(doubled, [[4, 4, 4, 4, 0], [4, 0, 0, 4, 0], [0, 4, 0, 0, 0]])


def test_counts_and_equations_of_pixels(measurement):
    """A point has two residuals, those with a sigma are counted separately, and a view has six freedoms at most."""
    assert measurement.counts() == {"stated": 4, "pixel_px": 10}
    assert measurement.equations().tolist() == [6, 4, 2]


def test_squares_are_of_points_without_a_sigma(measurement):
    """Each point is 5 px off: at a sigma of 5 px its square is one, and stated ones do not count."""
    squares = measurement.with_noise(Noise(pixel_px=5.0)).squares(AHEAD, LENS)
    assert squares == {"pixel_px": pytest.approx(5.0)}


def test_cost_is_the_weighted_square(measurement):
    """The cost is the weighted square over all seen points, view by view."""
    view = measurement.with_noise(Noise(pixel_px=5.0)).linearise(AHEAD, LENS, False)
    np.testing.assert_allclose(view.cost, [25 * 16 + 3, 25 * 16 + 1, 1])


def test_residuals_are_predicted_minus_seen(measurement):
    """Residuals are in pixels, and NaN for unseen points."""
    off = measurement.residual_px(AHEAD, LENS)
    np.testing.assert_allclose(off[SEEN], np.tile([3.0, 4.0], (SEEN.sum(), 1)))
    assert np.isnan(off[~SEEN]).all()


def test_thinned_points_are_spread_with_their_data(measurement):
    """Two of five points are far apart, with their data. Three are as many as requested, and five are all."""
    with_relative = replace(measurement, relative=np.tile(np.arange(5.0), (3, 1)))
    few = with_relative.thin(2)
    np.testing.assert_array_equal(few.points_in_target, POINTS[[2, 4]])
    np.testing.assert_array_equal(few.seen, SEEN[:, [2, 4]])
    np.testing.assert_array_equal(few.stated, STATED[:, [2, 4]])
    np.testing.assert_array_equal(few.pixels, measurement.pixels[:, [2, 4]])
    np.testing.assert_array_equal(few.weight, measurement.weight[:, [2, 4]])
    np.testing.assert_array_equal(few.relative, [[2.0, 4.0]] * 3)
    assert len(measurement.thin(3).points_in_target) == 3
    assert len(measurement.thin(5).points_in_target) == 5
    assert measurement.thin(3).relative is None


@pytest.mark.parametrize("count", [11, 12])
@pytest.mark.parametrize("most", [2, 5, 6, 12])
def test_paired_points_are_thinned_together(count, most):
    """A point is kept with the one at its place if the target is read from the other end, without half pairs.

    They stay in order, so that their places correspond, and few points all stay.
    """
    places = np.random.default_rng(1).uniform(size=(count, 3)) * [1, 1, 0]
    every = np.tile(np.arange(float(count)), (1, 1))
    few = PixelMeasurement(places, np.stack([every, every], -1), every >= 0, every, every).thin(most, is_paired=True)
    kept = few.stated[0].astype(int).tolist()
    assert len(set(kept)) == len(kept) <= most + most % 2
    assert [count - 1 - k for k in kept] == kept[::-1]
    assert kept == sorted(kept)
    assert len(kept) == count or most < count
    np.testing.assert_array_equal(few.points_in_target, places[kept])


def test_views_are_selected_with_their_data(measurement):
    """Selected views keep all of their data, in the requested order."""
    taken = replace(measurement, relative=np.tile(np.arange(3.0)[:, None], (1, 5))).take(np.array([2, 0]))
    np.testing.assert_array_equal(taken.seen, SEEN[[2, 0]])
    np.testing.assert_array_equal(taken.stated, STATED[[2, 0]])
    np.testing.assert_array_equal(taken.pixels, measurement.pixels[[2, 0]])
    np.testing.assert_array_equal(taken.weight, measurement.weight[[2, 0]])
    np.testing.assert_array_equal(taken.relative[:, 0], [2.0, 0.0])
    assert measurement.take(np.array([0])).relative is None


def test_rows_of_a_batch_are_selected(measurement):
    """Data shared by all entries are kept, and separate data are selected by row, with separate or shared weights."""
    assert measurement.take_batch(np.array([1])).pixels.shape == (3, 5, 2)
    twice = {
        name: np.stack([value, 2 * value]) for name in ("pixels", "weight") for value in [getattr(measurement, name)]
    }
    own = replace(measurement, **twice).take_batch(np.array([1]))
    np.testing.assert_array_equal(own.pixels, 2 * measurement.pixels[None])
    np.testing.assert_array_equal(own.weight, 2 * measurement.weight[None])
    np.testing.assert_array_equal(own.seen, SEEN)
    np.testing.assert_array_equal(own.stated, STATED)
    seen = np.stack([SEEN, ~SEEN])
    masked = replace(measurement, seen=seen, stated=1.0 * seen, relative=2.0 * seen).take_batch(np.array([1]))
    np.testing.assert_array_equal(masked.seen, [~SEEN])
    np.testing.assert_array_equal(masked.stated, [1.0 * ~SEEN])
    np.testing.assert_array_equal(masked.relative, [2.0 * ~SEEN])


@pytest.mark.parametrize("lens_each", [False, True])
def test_batch_entries_equal_separate_linearisations(measurement, lens_each):
    """Chunks have no effect, whether all entries share one lens or each has its own."""
    count = 1000
    rng = np.random.default_rng(0)
    away = SE3.exp(0.1 * rng.standard_normal((count, 3, 6)))
    poses = SE3(AHEAD.rotation @ away.rotation, AHEAD.translation + away.translation)
    lens = LENS
    if lens_each:
        lens = LENS.with_parameters(LENS.parameters + rng.standard_normal((count, 4)))
    together = measurement.linearise(poses, lens, False)
    for row in (0, 479, 480, 481, 960, 999):
        alone = measurement.linearise(poses[row], lens[row] if lens_each else lens, False)
        for part, each in zip(together, alone, strict=True):
            np.testing.assert_allclose(part[row], each, rtol=1e-9, atol=1e-9 * np.abs(each).max())


@pytest.mark.parametrize(("shape", "lens", "chunks"), [
    ((9,), False, [9]),
    ((10,), False, [6, 4]),
    ((3,), True, [3]),
    ((4,), True, [2, 2]),
    ((4, 2), False, [4]),
    ((5, 2), False, [3, 2]),
    ((2, 7), False, [1, 1]),
    ((40, 0), False, [40]),
])  # fmt: skip
@pytest.mark.parametrize("lens_each", [False, True])
def test_chunk_sizes_follow_the_number_of_points(measurement, monkeypatch, shape, lens, chunks, lens_each):
    """A chunk has 34 points, or 12 with a free lens, or half as many again, and at least one view or entry.

    Each has its own lenses.
    """
    monkeypatch.setattr(pixels, "_CHUNK_POINTS", 34)
    monkeypatch.setattr(pixels, "_CHUNK_LENS_POINTS", 12)
    found, whole = [], PixelMeasurement._linearise

    def watched(of, poses, camera, lens):
        found.append((poses.shape[0], camera.parameters.shape[:-1]))
        return whole(of, poses, camera, lens)

    monkeypatch.setattr(PixelMeasurement, "_linearise", watched)
    rows = np.arange(shape[-1]) % 3
    poses = AHEAD[np.broadcast_to(rows, shape)]
    own = lens_each and len(shape) > 1
    camera = LENS.with_parameters(LENS.parameters + np.arange(shape[0])[:, None]) if own else LENS
    together = measurement.take(rows).linearise(poses, camera, lens)
    assert found == [(count, (count,) if own else ()) for count in chunks]
    for k in range(shape[0] if own and shape[-1] else 0):
        alone = measurement.take(rows).linearise(poses[k], camera[k], lens)
        np.testing.assert_allclose(together.gradient[k], alone.gradient, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("lens", ["pinhole", "fisheye"])
def test_free_lens_equations_are_sums_over_points(measurement, lens):
    """Gradient and information by pose and lens are sums over derivatives of all points, also for rotated views."""
    camera = Camera(lens, [100.0, 102.0, 50.0, 40.0, 0.05, -0.01, 2e-3, 1e-3])
    poses = AHEAD @ SE3.exp(np.random.default_rng(3).normal(scale=0.2, size=(3, 6)))
    of_points = point_jacobians(measurement, poses, camera, True)
    view = measurement.linearise(poses, camera, True)
    jacobian = of_points.jacobian.reshape(3, -1, 14)
    scale = np.sqrt(np.einsum("nri,nri->i", jacobian, jacobian))
    gradient = np.einsum("nri,nr->ni", jacobian, of_points.residual.reshape(3, -1))
    np.testing.assert_allclose(view.gradient / scale, gradient / scale, atol=1e-11)
    information = jacobian.mT @ jacobian / np.outer(scale, scale)
    np.testing.assert_allclose(view.information / np.outer(scale, scale), information, atol=1e-13)


def test_batch_of_one_equals_the_single_result(measurement):
    """A batch of one has the result of its entry, with a separate lens and without."""
    camera = replace(LENS, parameters=np.append(LENS.parameters, [0.01, 0.0, 1e-3, 0.0]))
    alone = measurement.linearise(AHEAD, camera, True)
    one = SE3(AHEAD.rotation[None], AHEAD.translation[None])
    for lens in (camera, camera.with_parameters(camera.parameters[None])):
        for of, expected in zip(measurement.linearise(one, lens, True), alone, strict=True):
            np.testing.assert_array_equal(of, expected[None])
    seen_anew = replace(measurement, pixels=measurement.pixels[None], weight=measurement.weight[None])
    for of, expected in zip(seen_anew.linearise(one, camera, True), alone, strict=True):
        np.testing.assert_array_equal(of, expected[None])


def test_noisier_pixels_have_a_larger_shared_error(measurement):
    """The shared error grows by the same factor, so that cost, gradient and information decrease by its square."""
    shaken = replace(measurement, common_px=0.7)
    for wide, plain in zip(
        shaken.noisier(3.0).linearise(AHEAD, LENS, False), shaken.linearise(AHEAD, LENS, False), strict=True
    ):
        np.testing.assert_allclose(9 * wide, plain, rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize("lens", [False, True])
def test_many_views_equal_few_of_them(measurement, lens):
    """Chunks of views have no effect, nor have views of a batch with separate data."""
    rng = np.random.default_rng(0)
    rows = rng.integers(0, 3, 9000)
    many = measurement.take(rows)
    poses = SE3(AHEAD.rotation[rows], AHEAD.translation[rows] + 0.1 * rng.standard_normal((9000, 3)))
    together = many.linearise(poses, LENS, lens)
    for some in (slice(0, 3), slice(2398, 2402), slice(5758, 5762), slice(8997, 9000)):
        numbers = np.arange(9000)[some]
        alone = many.take(numbers).linearise(poses[numbers], LENS, lens)
        for part, each in zip(together, alone, strict=True):
            np.testing.assert_allclose(part[some], each, rtol=1e-9, atol=1e-9 * np.abs(each).max())


def test_shapes_have_their_own_columns(measurement):
    """After pose and lens, columns of moved target points equal differences of the cost."""
    by_shape = np.random.default_rng(2).standard_normal((5, 3, 2))
    view = measurement.linearise_shape(AHEAD, LENS, True, by_shape)
    plain = measurement.linearise(AHEAD, LENS, True)
    assert view.gradient.shape == (3, 12)
    np.testing.assert_allclose(view.gradient[:, :10], plain.gradient)
    np.testing.assert_allclose(view.information[:, :10, :10], plain.information)

    def cost(step):
        """The cost of a target with moved points."""
        return replace(measurement, points_in_target=POINTS + by_shape @ step).linearise(AHEAD, LENS, False).cost

    for k in range(2):
        step = 1e-5 * np.eye(2)[k]
        np.testing.assert_allclose(view.gradient[:, 10 + k], (cost(step) - cost(-step)) / 4e-5, rtol=1e-5, atol=1e-5)
