"""Tests of classifying views, shared stops and points by their prediction from all else, at the true state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from tests.ends import with_eye, with_hand
from tests.pose_problem import pose_problem

from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared, leave_one_out
from basecal.estimation.outliers import classify
from basecal.estimation.outliers.classify import CHANCE_OF_VIEW, classify_inliers, is_stated, view_scale
from basecal.estimation.outliers.inlier_mask import InlierMask, all_inliers
from basecal.estimation.outliers.robust_scale import robust_scale
from basecal.estimation.outliers.view_ransac import PointViews
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

NOISY = (3e-4, 5e-4)


def problem_at_truth(scenario, seed=0):
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    return problem, State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))


def with_pixels(problem, change):
    """The problem with other pixels in its only group."""
    (group,) = problem.groups
    pixels = group.measurement.pixels.copy()
    change(pixels)
    return problem.with_groups([replace(group, measurement=replace(group.measurement, pixels=pixels))])


def bump_hand(problem, views, by=(0.05, 0, 0, 0, 0, 0)):
    """The problem with a bumped hand in some views of its only group."""
    (group,) = problem.groups
    off = np.zeros((len(group), 6))
    off[views] = by
    return problem.with_groups([with_hand(group, base_from_flange=group.hand.base_from_flange @ SE3.exp(off))])


def classify_first_group(problem, state, kept=None):
    found = classify_inliers(problem, state, kept or all_inliers(problem))
    return found.kept.views[0], found.kept.points[0], found


def test_is_stated_needs_all_sigmas():
    """All sigmas have to be stated, and a problem without residuals lacks none."""
    assert is_stated(pose_problem(np.zeros((3, 6)), np.ones(6))[0])
    assert not is_stated(pose_problem(np.zeros((3, 6)), None)[0])
    assert is_stated(pose_problem(np.zeros((0, 6)), None)[0])


def test_view_scale_counts_the_unknowns(rng):
    """The scale of views is the robust scale with one freedom less for each column, at the chance of a view."""
    problem, _ = pose_problem(np.zeros((40, 6)), None)
    squares = [MahalanobisSquared(4.0 * rng.chisquare(6, 40), np.full(40, 6))]
    found = view_scale(problem, squares)
    assert found.variance == robust_scale(squares, 6, False, CHANCE_OF_VIEW).variance > 2.0
    assert found.chance == CHANCE_OF_VIEW
    stated = pose_problem(np.zeros((40, 6)), np.ones(6))[0]
    assert view_scale(stated, [MahalanobisSquared(1.2 * squares[0].value / 4.0, squares[0].freedoms)]).variance == 1.0


@pytest.mark.parametrize("target", ["charuco", "points", "pose", "points3d", "led"])
def test_clean_views_are_inliers(target):
    """Twelve clean views of any type are kept with every point."""
    problem, state = problem_at_truth(Scenario(samples=12, target=target, robot_noise=NOISY))
    views, points, _ = classify_first_group(problem, state)
    assert views.all()
    assert points.all()


@pytest.mark.parametrize("target", ["charuco", "points", "pose", "points3d"])
def test_view_of_a_bumped_arm_is_left_out(target):
    """Only the views of two instants with the hand 5 cm off are excluded, and their points are not marked."""
    problem, state = problem_at_truth(Scenario(samples=12, target=target, robot_noise=NOISY))
    views, points, found = classify_first_group(bump_hand(problem, [3, 7]), state)
    assert np.flatnonzero(~views).tolist() == [3, 7]
    assert points.all()
    assert np.sqrt(found.views[0].value[[3, 7]]).min() > 20
    assert np.sqrt(np.delete(found.views[0].value, [3, 7])).max() < 6


def test_stray_corner_is_excluded_alone():
    """A corner seven sigmas off is excluded, and its view stays."""

    def stray(pixels):
        pixels[2, 5] += 1.5

    problem, state = problem_at_truth(Scenario(samples=12, robot_noise=NOISY))
    views, points, _ = classify_first_group(with_pixels(problem, stray), state)
    assert views.all()
    assert np.argwhere(~points).tolist() == [[2, 5]]


def test_view_with_mostly_stray_corners_is_excluded():
    """A view with two thirds of its corners at random is excluded, and no other."""

    def stray(pixels):
        pixels[4, :24] += np.random.default_rng(0).uniform(-300, 300, (24, 2))

    problem, state = problem_at_truth(Scenario(samples=12, robot_noise=NOISY))
    assert np.flatnonzero(~classify_first_group(with_pixels(problem, stray), state)[0]).tolist() == [4]


def test_stray_point_of_few_is_excluded_alone():
    """One of five points is 40 px off: the others are as predicted by all else, and the view stays."""

    def stray(pixels):
        pixels[6, 1] += (30.0, -20.0)

    problem, state = problem_at_truth(Scenario(samples=12, target="points", robot_noise=(1e-5, 1e-5)), 2)
    views, points, _ = classify_first_group(with_pixels(problem, stray), state)
    assert views.all()
    assert np.argwhere(~points).tolist() == [[6, 1]]


def test_agreeing_views_and_points_are_readmitted():
    """A formerly excluded view with its points is readmitted if all else predicts it."""
    problem, state = problem_at_truth(Scenario(samples=12, target="points", robot_noise=NOISY), 2)
    before = InlierMask((np.arange(12) != 5,), all_inliers(problem).points)
    views, points, _ = classify_first_group(problem, state, before)
    assert views.all()
    assert points.all()
    still_off = classify_first_group(bump_hand(problem, [5]), state, before)[0]
    assert np.flatnonzero(~still_off).tolist() == [5]


def test_excluded_points_stay_excluded():
    """Excluded points have no distance, and a view that loses more than half of its points is excluded."""
    problem, state = problem_at_truth(Scenario(samples=8))
    before = all_inliers(problem)
    points = before.points[0].copy()
    points[1, :10] = points[3, :19] = False
    views, kept, found = classify_first_group(problem, state, InlierMask(before.views, (points,)))
    assert np.flatnonzero(~views).tolist() == [3]
    assert not kept[1, :10].any()
    assert np.isnan(found.points[0].value[1, :10]).all()
    assert np.isfinite(found.points[0].value[1, 10:]).all()


def test_shared_stop_with_an_error_excludes_its_views():
    """The eye is 40 sigmas off at one station: all of its views are excluded, and those of no other station."""
    scenario = Scenario(samples=20, arms="stations", stations=5, robot_noise=NOISY)
    problem, state = problem_at_truth(scenario)
    (group,) = problem.groups
    errors = state.stop_errors.copy()
    stop = int(np.bincount(group.eye.stop).argmax())
    errors[stop, 0] = 40.0
    there = group.eye.stop == stop
    shift = np.where(there[:, None], -errors[stop] * problem.stops.sigma[stop], 0.0)
    poses = group.eye.base_from_flange @ SE3.exp(shift)
    moved = problem.with_groups([with_eye(group, base_from_flange=poses)])
    views, _, found = classify_first_group(moved, replace(state, stop_errors=errors))
    assert np.flatnonzero(~views).tolist() == np.flatnonzero(there).tolist()
    assert found.stops.value[stop] > 30**2 / 6


@pytest.mark.parametrize(("off_px", "stays"), [("each elsewhere", True), ("together", False)])
def test_separate_stray_points_keep_their_view(off_px, stays):
    """With three of five points off in different ways, the other two stay.

    Points shifted with their whole view are all excluded.
    """

    def stray(pixels):
        if off_px == "together":
            pixels[6] += (40.0, -30.0)
        else:
            pixels[6, :3] += ((60.0, -40.0), (-50.0, 30.0), (20.0, 70.0))

    problem, state = problem_at_truth(Scenario(samples=12, target="points", robot_noise=(1e-5, 1e-5)), 2)
    views, points, _ = classify_first_group(with_pixels(problem, stray), state)
    assert np.flatnonzero(~views).tolist() == ([] if stays else [6])
    if stays:
        assert np.argwhere(~points).tolist() == [[6, 0], [6, 1], [6, 2]]


@pytest.mark.parametrize(("target", "numbers"), [("points", 2), ("points3d", 3)])
def test_readmitted_points_use_their_freedoms(monkeypatch, target, numbers):
    """The limit is for two freedoms of a pixel, or three of a point in space.

    It has the chance of excluding a good point.
    """
    limits, largest_agreement = [], PointViews.largest_agreement

    def kept_limit(views, poses, limit):
        """`largest_agreement`, with its limit recorded."""
        limits.append(limit)
        return largest_agreement(views, poses, limit)

    monkeypatch.setattr(PointViews, "largest_agreement", kept_limit)
    problem, state = problem_at_truth(Scenario(samples=12, target=target, robot_noise=NOISY), 2)
    before = InlierMask((np.arange(12) != 5,), all_inliers(problem).points)
    views, _, _ = classify_first_group(bump_hand(problem, [5]), state, before)
    assert not views[5]
    assert limits == [pytest.approx(chi2.isf(1e-6, numbers), rel=1e-6)]


def test_stop_mask_selects_views_of_bad_stops():
    """Views at such a stop of either arm are selected. The index -1 of views without a stop is not the last stop."""
    problem, _ = pose_problem(np.zeros((4, 6)), None)
    (group,) = problem.groups
    group = with_hand(with_eye(group, stop=np.array([0, 1, -1, -1])), stop=np.array([2, -1, 0, -1]))
    assert classify._stop_mask(group, np.array([True, False, False])).tolist() == [True, False, True, False]
    assert classify._stop_mask(group, np.array([False, False, True])).tolist() == [True, False, False, False]
    assert classify._stop_mask(group, np.zeros(0, dtype=bool)).tolist() == [False] * 4


def point_group(seen):
    """A group of views of points measured in space, with a visibility mask."""
    seen = np.array(seen, dtype=bool)
    points = np.random.default_rng(0).standard_normal((seen.shape[1], 3))
    weight = np.where(seen, 100.0, 0.0)
    measurement = PointMeasurement(points, np.tile(points, (len(seen), 1, 1)), seen, weight, weight)
    (group,) = pose_problem(np.zeros((len(seen), 6)), None)[0].groups
    return replace(group, measurement=measurement)


def test_half_of_the_seen_points_suffice():
    """At least one point is needed, and a pose always suffices."""
    seen = [[1] * 6, [1] * 6, [1, 1, 1, 1, 0, 0], [1, 1, 1, 1, 0, 0], [0] * 6]
    left = np.array(
        [[1, 1, 1, 0, 0, 0], [1, 1, 0, 0, 0, 0], [1, 1, 0, 0, 1, 1], [1, 0, 0, 0, 1, 1], [1] * 6], dtype=bool
    )
    assert classify._has_enough(point_group(seen), left).tolist() == [True, False, True, False, False]
    (poses,) = pose_problem(np.zeros((2, 6)), None)[0].groups
    assert classify._has_enough(poses, np.zeros((2, 1), dtype=bool)).tolist() == [True, True]


def test_view_with_consistent_points_is_off_as_a_whole():
    """A view whose points all agree with each other is off as a whole, for any pose.

    It is not if a point deviates or not all seen points agree.
    """
    group = point_group([[1] * 6, [1] * 6, [1, 1, 1, 1, 1, 0]])
    away = SE3.exp(np.full(6, 0.3))
    at = away @ group.measurement.points_in_camera
    at[1, 2] += 0.5
    at[2, 5] += 9.0
    few = replace(group.measurement, points_in_camera=at)
    found = PointViews(few, None).agreement(SE3.identity((3,)), 30.0)
    assert classify._agrees_with_itself(few, found, None, 30.0).tolist() == [True, False, True]


@pytest.mark.parametrize("variance", [1.0, 4.0])
def test_view_is_predicted_by_all_others(rng, variance):
    """The prediction is the mean of the others with an unknown own stop error, and has the covariance of both."""
    sigma, stop = np.full(6, 2e-3), np.repeat([1e-3, 3e-3], 3)
    problem, state = pose_problem(1e-6 * rng.standard_normal((5, 6)), sigma, stop_sigma=stop)
    state = replace(state, stop_errors=rng.standard_normal((5, 6)))
    weights = np.array([1.0, 0.0, 1.0, 0.0, 1.0])
    about = leave_one_out(problem, state, [weights])
    found = classify._prior(about, 0, np.array([1, 3]), variance)
    np.testing.assert_allclose(found.camera_from_target.log(), 0.0, atol=1e-9)
    spread = variance * ((sigma**2 + stop**2) / 3 + stop**2)
    np.testing.assert_allclose(
        found.information, np.tile(np.diag(1 / spread), (2, 1, 1)), rtol=0.02, atol=0.02 / spread.min()
    )
    exact, state = pose_problem(np.zeros((3, 6)), np.full(6, 1e-12))
    known = leave_one_out(exact, state, [np.ones(3)])
    sure = classify._prior(known, 0, np.array([0]), 1.0).information
    np.testing.assert_allclose(sure, [1e14 * np.eye(6)], rtol=1e-6)


@pytest.mark.parametrize(("kept", "chance"), [(12, 1e-4), (11, 1e-4), (10, 1e-3)])
def test_chance_increases_if_many_views_are_excluded(kept, chance):
    """A clean view is excluded more often if more than a tenth of the views is excluded.

    An empty problem keeps the usual chance.
    """
    problem, state = pose_problem(1e-4 * np.random.default_rng(0).standard_normal((12, 6)), np.full(6, 1e-3))
    before = InlierMask((np.arange(12) < kept,), all_inliers(problem).points)
    assert classify_inliers(problem, state, before).view_scale.chance == chance
    none, state = pose_problem(np.zeros((0, 6)), np.full(6, 1e-3))
    assert classify_inliers(none, state, all_inliers(none)).view_scale.chance == 1e-4


@pytest.mark.parametrize(("target", "kinds"), [("pose", 0), ("led", 0), ("points", 1)])
def test_only_views_of_several_points_are_searched(monkeypatch, target, kinds):
    """Poses and LEDs have no points that could agree without the rest."""
    asked, subset_fits = [], PointViews.subset_fits
    monkeypatch.setattr(PointViews, "subset_fits", lambda *of: asked.append(of) or subset_fits(*of))
    problem, state = problem_at_truth(Scenario(samples=12, target=target, robot_noise=NOISY), 2)
    before = InlierMask((np.arange(12) != 5,), all_inliers(problem).points)
    classify_first_group(bump_hand(problem, [5]), state, before)
    assert len(asked) == kinds
