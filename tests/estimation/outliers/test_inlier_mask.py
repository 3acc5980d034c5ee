"""Tests of masks of inlier views and points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tests.pose_problem import pose_problem

from basecal.estimation.outliers.inlier_mask import (
    InlierMask,
    all_inliers,
    inlier_problem,
    point_count,
    select_samples,
    without_points,
    without_unseen_stops,
)
from basecal.estimation.problem.build import build_problem
from basecal.simulation import Scenario, simulate


def board_problem(target="chessboard"):
    made = simulate(Scenario(samples=4, target=target), 2)
    return build_problem(made.cell, made.recording)[0]


def test_all_inliers_keeps_all_views_and_points():
    """Every view and every point is kept, with one entry for a measured pose."""
    problem = board_problem()
    mask = all_inliers(problem)
    (group,) = problem.groups
    assert mask.views[0].shape == (4,)
    assert mask.points[0].shape == (4, len(group.measurement.points_in_target))
    assert mask.views[0].all()
    assert mask.points[0].all()
    assert all_inliers(pose_problem(np.zeros((3, 6)), np.ones(6))[0]).points[0].shape == (3, 1)
    assert point_count(group.measurement) == mask.points[0].shape[1]
    assert mask.weights[0].tolist() == [1.0] * 4


def test_masks_are_compared_by_views_and_points():
    """Masks are unequal if any view or point differs."""
    one = InlierMask((np.array([True, False]),), (np.ones((2, 3), dtype=bool),))
    views = InlierMask((np.array([True, True]),), one.points)
    points = InlierMask(one.views, (np.array([[True] * 3, [True, False, True]]),))
    assert one.same_as(InlierMask((one.views[0].copy(),), (one.points[0].copy(),)))
    assert not one.same_as(views)
    assert not one.same_as(points)
    assert one.weights[0].tolist() == [1.0, 0.0]


def test_excluded_points_are_unseen():
    """Excluded points have no weight, and the others keep theirs, in both readings of a chessboard."""
    problem = board_problem()
    (group,) = problem.groups
    kept = np.ones(group.measurement.seen.shape, dtype=bool)
    kept[1, :5] = False
    (fewer,) = without_points(problem, [kept]).groups
    np.testing.assert_array_equal(fewer.measurement.seen, group.measurement.seen & kept)
    np.testing.assert_array_equal(fewer.measurement.weight, np.where(kept, group.measurement.weight, 0.0))
    np.testing.assert_array_equal(fewer.measurement.stated, np.where(kept, group.measurement.stated, 0.0))
    assert len(fewer.readings) == 2
    np.testing.assert_array_equal(fewer.readings[1].seen[1, -5:], False)
    assert group.measurement.mask_points(np.ones_like(kept)) is group.measurement
    poses = pose_problem(np.zeros((2, 6)), np.ones(6))[0].groups[0].measurement
    assert poses.mask_points(np.zeros((2, 1), dtype=bool)) is poses


def test_inlier_problem_has_only_inliers():
    """Excluded views and groups without views are removed, and the alternative readings are dropped."""
    problem = board_problem()
    mask = all_inliers(problem)
    some = InlierMask((np.array([True, False, True, False]),), mask.points)
    (group,) = inlier_problem(problem, some).groups
    assert group.sample.tolist() == problem.groups[0].sample[[0, 2]].tolist()
    assert group.readings == ()
    assert inlier_problem(problem, InlierMask((np.zeros(4, dtype=bool),), mask.points)).groups == ()


def test_samples_are_selected_by_number():
    """Views of these samples are in the order of the problem, and groups without views are removed."""
    problem = board_problem()
    numbers = problem.groups[0].sample
    (group,) = select_samples(problem, numbers[[3, 1]]).groups
    assert group.sample.tolist() == numbers[[1, 3]].tolist()
    assert select_samples(problem, np.array([-5])).groups == ()


def test_errors_of_unused_stops_are_zero():
    """A stop without remaining views has no error."""
    problem, state = pose_problem(np.zeros((3, 6)), np.ones(6), stop_sigma=np.ones(6))
    state = replace(state, stop_errors=np.ones((3, 6)))
    fewer = problem.with_groups(g.take(np.array([0, 2])) for g in problem.groups)
    np.testing.assert_array_equal(without_unseen_stops(fewer, state).stop_errors[:, 0], [1, 0, 1])
    np.testing.assert_array_equal(without_unseen_stops(problem, state).stop_errors, 1.0)


def test_intersection_of_masks():
    """A view, or a point, that either mask excludes is excluded."""
    first = InlierMask((np.array([True, True, False]),), (np.array([[True, False], [True, True], [True, True]]),))
    second = InlierMask((np.array([True, False, True]),), (np.array([[True, True], [False, True], [True, True]]),))
    both = first.intersection(second)
    np.testing.assert_array_equal(both.views[0], [True, False, False])
    np.testing.assert_array_equal(both.points[0], [[True, False], [False, True], [True, True]])
