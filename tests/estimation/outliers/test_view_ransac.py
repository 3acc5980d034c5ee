"""Tests of the largest agreement within a view, with or without a prior of its pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.ends import with_hand

from basecal.estimation.outliers import view_ransac as ransac
from basecal.estimation.outliers.consensus import agreeing_samples
from basecal.estimation.outliers.view_ransac import PointViews, Prior
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import SE3, Camera
from basecal.simulation import Scenario, simulate

LIMIT = 27.6


def view_ransac(measurement, start, camera, limit, prior=None):
    """The largest agreement within each view, by subsets of its points."""
    views = PointViews(measurement, camera, prior)
    return views.largest_agreement(views.subset_fits(start), limit)


def explain_views(measurement, pose, camera, limit, prior=None):
    """The agreement of views' points with given poses."""
    return PointViews(measurement, camera, prior).agreement(pose, limit)


def problem_at_truth(scenario, seed):
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    return problem, state, state.camera_from_target(problem.groups[0], problem.stops)


def test_third_of_board_points_wrong_are_found():
    """Twelve of 36 points of every view are random: exactly these are found, from a start 5 cm off."""
    problem, state, true = problem_at_truth(Scenario(samples=8), 0)
    measurement = problem.groups[0].measurement
    rng = np.random.default_rng(0)
    wrong = rng.permuted(np.tile(np.arange(36) < 12, (8, 1)), axis=1)
    pixels = np.where(wrong[..., None], rng.uniform((0, 0), (1280, 720), (8, 36, 2)), measurement.pixels)
    near = true @ SE3.exp(rng.uniform(-0.05, 0.05, (8, 6)))
    found = view_ransac(replace(measurement, pixels=pixels), near, state.cameras["wrist"], LIMIT)
    np.testing.assert_array_equal(found.points, ~wrong)


def test_prior_decides_ambiguous_points():
    """Three of five points are wrong. With the pose known to 0.1 mm and 0.1 mrad, the other two are identified."""
    problem, state, true = problem_at_truth(Scenario(samples=6, target="points", robot_noise=(1e-5, 1e-5)), 2)
    measurement = problem.groups[0].measurement
    assert measurement.seen.shape == (6, 5)
    wrong = np.tile(np.arange(5) < 3, (6, 1))
    pixels = measurement.pixels + np.where(wrong[..., None], (9.0, -14.0), 0.0) * np.arange(1, 6)[:, None]
    prior = Prior(true, np.tile(1e8 * np.eye(6), (6, 1, 1)))
    found = view_ransac(replace(measurement, pixels=pixels), true, state.cameras["wrist"], LIMIT, prior)
    np.testing.assert_array_equal(found.points, ~wrong)


def test_consistent_samples_are_separated():
    """Ten of twenty samples have poses 50 mm off: at the truth the other ten are separate.

    Clean samples have no gap.
    """
    problem, state, _ = problem_at_truth(Scenario(samples=20), 1)
    group = problem.groups[0]
    shift = np.zeros((20, 6))
    shift[10:, :3] = 0.05
    moved = with_hand(group, base_from_flange=group.hand.base_from_flange @ SE3.exp(shift))
    assert agreeing_samples(problem.with_groups([moved]), [state]) == tuple(range(10))
    assert agreeing_samples(problem, [state]) == ()


def with_stray_points(problem, count, seed):
    """The views of a problem's first group with `count` random points each."""
    measurement = problem.groups[0].measurement
    n, p = measurement.seen.shape
    rng = np.random.default_rng(seed)
    wrong = rng.permuted(np.tile(np.arange(p) < count, (n, 1)), axis=1)
    pixels = np.where(wrong[..., None], rng.uniform((0, 0), (1280, 720), (n, p, 2)), measurement.pixels)
    return replace(measurement, pixels=pixels), wrong


@pytest.mark.parametrize("target", ["chessboard", "points"])
def test_chunk_size_has_no_effect(target, monkeypatch):
    """Hypotheses fitted one by one give the same poses, points and costs as all together."""
    problem, state, true = problem_at_truth(Scenario(samples=5, target=target), 3)
    measurement, _ = with_stray_points(problem, 2, 3)
    near = true @ SE3.exp(np.random.default_rng(4).uniform(-0.02, 0.02, (5, 6)))
    together = view_ransac(measurement, near, state.cameras["wrist"], LIMIT)
    monkeypatch.setattr(ransac, "_CHUNK_POINTS", 1)
    alone = view_ransac(measurement, near, state.cameras["wrist"], LIMIT)
    np.testing.assert_array_equal(together.points, alone.points)
    np.testing.assert_allclose(together.cost, alone.cost, rtol=1e-6)
    np.testing.assert_allclose((together.camera_from_target.inverse() @ alone.camera_from_target).log(), 0.0, atol=1e-6)


def test_hypotheses_are_reused_for_every_limit():
    """Poses fitted once give, for each limit, the result of a search with that limit."""
    problem, state, true = problem_at_truth(Scenario(samples=5), 5)
    measurement, wrong = with_stray_points(problem, 9, 5)
    lens = state.cameras["wrist"]
    views = PointViews(measurement, lens)
    poses = views.subset_fits(true)
    assert poses.translation.shape == (42, 5, 3)
    for limit in (LIMIT, 30 * LIMIT):
        found, anew = views.largest_agreement(poses, limit), view_ransac(measurement, true, lens, limit)
        np.testing.assert_array_equal(found.points, anew.points)
        np.testing.assert_array_equal(found.cost, anew.cost)
        np.testing.assert_array_equal(found.points & wrong, False)


def test_single_point_agrees_with_its_prior():
    """A single point has no subsets. It is kept at its prediction, and excluded 40 px off."""
    problem, state, true = problem_at_truth(Scenario(samples=6, target="led", robot_noise=(1e-5, 1e-5)), 6)
    measurement = problem.groups[0].measurement
    aside = np.arange(6) < 2
    pixels = measurement.pixels + np.where(aside[:, None, None], (40.0, 0.0), 0.0)
    prior = Prior(true, np.tile(1e10 * np.eye(6), (6, 1, 1)))
    found = view_ransac(replace(measurement, pixels=pixels), true, state.cameras["wrist"], LIMIT, prior)
    np.testing.assert_array_equal(found.points[:, 0], ~aside)


@pytest.mark.parametrize(("points", "subsets"), [(4, 4 + 6), (5, 5 + 10), (8, 8 + 28)])
def test_few_points_use_all_but_one_or_two(points, subsets):
    """Up to eight points, every subset without one or two of them is tried, each once."""
    found = ransac._subsets(np.ones((1, points), dtype=bool))[:, 0]
    assert len(found) == subsets
    assert len(np.unique(found, axis=0)) == subsets
    assert set(found.sum(1).tolist()) == {points - 1, points - 2}


def test_many_points_use_random_subsets_of_five(rng):
    """With nine points or more, forty subsets of five visible points are drawn for each view.

    With four visible points all are used.
    """
    seen = np.ones((3, 30), dtype=bool)
    seen[1, ::2] = False
    seen[2, 4:] = False
    found = ransac._subsets(seen)
    assert found.shape == (40, 3, 30)
    assert np.all(found[:, :2].sum(-1) == 5)
    np.testing.assert_array_equal(found[:, 2], np.tile(seen[2], (40, 1)))
    assert not np.any(found & ~seen)
    assert len(np.unique(found[:, 0], axis=0)) > 35
    assert ransac._subsets(np.ones((1, 9), dtype=bool)).shape == (40, 1, 9)


def three_points(in_pixels, seen=((True, True, True),)):
    """Three points at (0, 0, 2), (1, 0, 2) and (0, 1, -2) m before the camera, seen where the first two are."""
    points = np.array([[0.0, 0, 2], [1, 0, 2], [0, 1, -2]])
    seen = np.array(seen)
    weight = np.array([[2.0, 3.0, 5.0]] * len(seen))
    if not in_pixels:
        at = np.tile(points + np.array([[0.1, 0, 0], [0, 0.2, 0.1], [0, 0, 0]]), (len(seen), 1, 1))
        return PointMeasurement(points, at, seen, weight, weight)
    pixels = np.tile(np.array([[640.0, 363.0], [1044.0, 360.0], [0.0, 0.0]]), (len(seen), 1, 1))
    return PixelMeasurement(points, pixels, seen, weight, weight)


CAMERA = Camera("pinhole", np.array([800.0, 800.0, 640.0, 360.0]), (1280, 720))


@pytest.mark.parametrize("in_pixels", [True, False])
def test_points_are_explained_by_their_squares(in_pixels):
    """Squares are over sigma, infinite behind the camera or without weight, zero if unseen, and limited in the cost."""
    of = three_points(in_pixels, [[True, True, True], [False, True, False]])
    found = explain_views(of, SE3.identity((2,)), CAMERA if in_pixels else None, 40.0)
    squares = [36.0, 144.0, np.inf] if in_pixels else [0.04, 0.45, 0.0]
    np.testing.assert_allclose(found.squares, [squares, [0.0, squares[1], 0.0]])
    agree = [True, not in_pixels, not in_pixels]
    assert found.points.tolist() == [agree, [False, agree[1], False]]
    np.testing.assert_allclose(found.cost, np.minimum(found.squares, 40.0).sum(1))
    light = replace(of, weight=of.weight * [0, 1, 1])
    assert np.isinf(explain_views(light, SE3.identity((2,)), CAMERA if in_pixels else None, 40.0).squares[0, 0])
    information = np.diag([1.0, 2, 3, 4, 5, 6])[None].repeat(2, 0)
    prior = Prior(SE3.from_rotvec(np.zeros((2, 3)), [[-1.0, 0, 0], [0, 0, -2.0]]), information)
    drawn = explain_views(of, SE3.identity((2,)), CAMERA if in_pixels else None, 40.0, prior)
    np.testing.assert_allclose(drawn.cost - found.cost, [1.0, 12.0])


def test_prior_is_added_to_a_view():
    """Squares, half their derivative, and their information are added. A selection of views has its own priors."""
    of, information = (
        three_points(False, [[True] * 3] * 2),
        np.diag([1.0, 2, 3, 4, 5, 6])[None] * np.array([1.0, 2.0])[:, None, None],
    )
    off = np.array([[0.1, 0.2, 0.3, 0, 0, 0], [0.3, 0.0, -0.2, 0, 0, 0]])
    prior = Prior(SE3.exp(-off), information)
    alone = of.linearise(SE3.identity((2,)), None, False)
    both = ransac._WithPrior(of, prior).linearise(SE3.identity((2,)), None, False)
    np.testing.assert_allclose(both.cost - alone.cost, np.einsum("ni,nij,nj->n", off, information, off))
    np.testing.assert_allclose(both.gradient - alone.gradient, np.einsum("nij,nj->ni", information, off), atol=1e-12)
    np.testing.assert_allclose(both.information - alone.information, information, atol=1e-12)
    second = ransac._WithPrior(of, prior).take(np.array([1])).linearise(SE3.identity((1,)), None, False)
    np.testing.assert_allclose(second.cost, both.cost[1:])


def test_better_agreement_is_chosen_for_each_view():
    """The one with the smaller cost is chosen, and the first if costs are equal."""
    of = three_points(False, [[True] * 3] * 3)
    one = explain_views(of, SE3.exp(np.array([[0.0] * 6, [0.1] * 6, [0.0] * 6])), None, 40.0)
    two = explain_views(of, SE3.exp(np.array([[0.1] * 6, [0.0] * 6, [0.0] * 6])), None, 40.0)
    two = replace(two, points=~two.points)
    better = one.better(two)
    np.testing.assert_array_equal(better.cost, np.minimum(one.cost, two.cost))
    np.testing.assert_allclose(better.camera_from_target.translation, 0.0)
    np.testing.assert_allclose(better.camera_from_target.rotation, np.tile(np.eye(3), (3, 1, 1)))
    np.testing.assert_array_equal(better.points, [one.points[0], two.points[1], one.points[2]])
    np.testing.assert_array_equal(better.squares, [one.squares[0], two.squares[1], one.squares[2]])


def test_best_of_several_poses_is_taken():
    """Each view has its own best pose, NaN poses are ignored, and the pose is refitted to the agreeing points."""
    points = np.random.default_rng(0).standard_normal((6, 3))
    seen, weight = np.ones((2, 6), dtype=bool), np.full((2, 6), 100.0)
    of = PointMeasurement(points, np.tile(points, (2, 1, 1)), seen, weight, weight)
    far, near = np.full(6, 0.5), np.full(6, 1e-3)
    poses = SE3.exp(np.array([[far, far], [far, near], [near, far], [np.full(6, np.nan)] * 2]))
    found = PointViews(of, None).largest_agreement(poses, LIMIT)
    np.testing.assert_allclose(found.camera_from_target.log(), 0.0, atol=1e-9)
    np.testing.assert_allclose(found.cost, 0.0, atol=1e-12)
    assert found.points.all()


def test_chunks_of_hypotheses_are_limited_by_memory():
    """A chunk has fifty thousand points, but at least one hypothesis. Views without points form one chunk."""
    assert list(ransac._chunks(5, 10, 2500)) == [slice(0, 2), slice(2, 4), slice(4, 5)]
    assert list(ransac._chunks(2, 100, 2500)) == [slice(0, 1), slice(1, 2)]
    assert list(ransac._chunks(3, 0, 10)) == [slice(0, 3)]
    assert list(ransac._chunks(0, 10, 10)) == []


@pytest.mark.parametrize(("points", "left"), [(1, []), (2, [1, 1]), (3, [2, 2, 2, 1, 1, 1])])
def test_subsets_of_fewest_points(points, left):
    """Subsets of one, two or three points leave at least one point."""
    found = ransac._subsets(np.ones((1, points), dtype=bool))
    assert found.shape == (len(left), 1, points)
    assert found.sum(-1).ravel().tolist() == left


def test_closed_form_poses_use_the_subset(monkeypatch):
    """Closed-form poses are used only for boards with many points. If there is none, the expected pose is used."""
    problem, state, true = problem_at_truth(Scenario(samples=3, pixel_px=0.01), 0)
    measurement, camera = problem.groups[0].measurement, state.cameras["wrist"]
    subsets = np.zeros((6, 36), dtype=bool)
    subsets[:5, [0, 5, 14, 30, 35]] = True
    near = SE3.exp(np.full((3, 6), 0.3))
    found = ransac._closed_form(measurement, subsets, camera, near)
    off = (SE3.stack([true[k % 3] for k in range(5)]).inverse() @ found[:5]).log()
    assert np.abs(off).max() < 0.03
    np.testing.assert_array_equal(found[5].matrix, near[2].matrix)
    asked, closed = [], ransac._closed_form
    monkeypatch.setattr(ransac, "_closed_form", lambda *of: asked.append(of) or closed(*of))
    PointViews(measurement, camera).subset_fits(true)
    assert len(asked) == 1
    for target in ("points", "points3d"):
        problem, state, true = problem_at_truth(Scenario(samples=3, target=target), 0)
        PointViews(problem.groups[0].measurement, state.cameras.get("wrist")).subset_fits(true)
    assert len(asked) == 1


def test_views_are_refitted_until_points_are_stable():
    """From poses slightly off, with points off by some sigmas, another fit to the agreeing points has no effect."""
    problem, state, true = problem_at_truth(Scenario(samples=30), 0)
    rng = np.random.default_rng(1)
    pixels = problem.groups[0].measurement.pixels
    thrown = rng.uniform(size=pixels.shape[:2]) < 0.3
    pixels = pixels + np.where(thrown[..., None], rng.normal(0, 1.5, pixels.shape), 0.0)
    views = PointViews(replace(problem.groups[0].measurement, pixels=pixels), state.cameras["wrist"])
    found = views._refit(true @ SE3.exp(rng.uniform(-2e-3, 2e-3, (30, 6))), LIMIT)
    again = views.agreement(views.fit(found.camera_from_target, found.points, 6), LIMIT).better(found)
    np.testing.assert_array_equal(again.points, found.points)
