"""Deviations are chi-square where the noise is true, and those of one view do not see that view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.studentized import (
    MahalanobisSquared,
    judged_by_view,
    leave_one_out,
    studentized,
    studentized_points,
    studentized_stops,
    studentized_views,
)
from basecal.estimation.outliers.inlier_mask import InlierMask, all_inliers, at_stops_of, inlier_problem
from basecal.estimation.outliers.robust_scale import robust_scale
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve, solve_from, solve_packed
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

NOISY = (3e-4, 5e-4)


def about(scenario, seed):
    made = simulate(scenario, seed)
    found = solve(made.cell, made.recording)
    return leave_one_out(found.problem, found.state, all_inliers(found.problem).weights)


def per_freedom(squares) -> np.ndarray:
    return np.concatenate([s.value[s.freedoms > 0] / s.freedoms[s.freedoms > 0] for s in squares])


@pytest.mark.parametrize(
    ("scenario", "freedoms"),
    [
        (Scenario(robot_noise=NOISY), 6),
        (Scenario(target="led", samples=40, camera_mount="fixed", robot_noise=(1e-4, 1e-4)), 2),
        (Scenario(target="pose"), 6),
        (Scenario(target="points3d", robot_noise=NOISY), 6),
        (Scenario(arms="stations", robot_noise=NOISY), 6),
    ],
    ids=["board", "light", "poses", "3-D points", "stations"],
)
def test_views_are_chi_square(scenario, freedoms):
    """Mean of d^2 / freedoms over five cells is 1 within five standard errors of independent views."""
    every = [s for seed in range(5) for s in studentized_views(about(scenario, seed))]
    assert {int(f) for s in every for f in s.freedoms} == {freedoms}
    mean = per_freedom(every)
    assert abs(mean.mean() - 1) < 5 * np.sqrt(2 / freedoms / len(mean))


@pytest.mark.parametrize("target", ["charuco", "points", "points3d"])
def test_points_are_chi_square(target):
    """Points judged by their view or by all else: mean 1 within five standard errors."""
    every = [
        s for seed in range(4) for s in studentized_points(about(Scenario(target=target, robot_noise=NOISY), seed))
    ]
    mean = per_freedom(every)
    assert abs(mean.mean() - 1) < 5 * np.sqrt(2 / every[0].freedoms.max() / len(mean))


def test_shared_stops_are_chi_square():
    """Errors of stops that several views share: mean 1 within five standard errors, of fewer than six freedoms each."""
    mean = per_freedom(
        [studentized_stops(about(Scenario(arms="stations", robot_noise=NOISY), seed)) for seed in range(8)]
    )
    assert len(mean) == 40
    assert abs(mean.mean() - 1) < 5 * np.sqrt(2 / 4 / len(mean))


@pytest.mark.parametrize("noise", [(0.0, 0.0), NOISY])
def test_a_view_deviates_alike_in_the_fit_and_out_of_it(noise):
    """The deviation of a view from the others does not depend on whether it was part of the fit, to 3 %.

    The problem is linear but for second order.
    """
    made = simulate(Scenario(robot_noise=noise, arms="stations"), seed=3)
    problem, _ = build_problem(made.cell, made.recording)
    found = solve_packed(problem, made.cell)
    within = studentized_views(leave_one_out(found.problem, found.state, all_inliers(problem).weights))[0].value[5]
    kept = InlierMask((np.arange(30) != 5,), all_inliers(problem).points)
    left = inlier_problem(problem, kept)
    others = solve_from(left, at_stops_of(left, found.state))
    without = studentized_views(leave_one_out(problem, others.state, kept.weights))[0].value[5]
    assert without == pytest.approx(within, rel=0.03)


def test_a_bump_of_known_size_deviates_by_as_much():
    """A pose off by 10 sigma in the noise of pixels and robots, at the true state, is 10 sigma off within 4."""
    made = simulate(Scenario(target="pose", pose_noise=(1e-3, 1e-3)), seed=1)
    problem, _ = build_problem(made.cell, made.recording)
    group = problem.groups[0]
    shift = np.zeros((30, 6))
    shift[4, 1] = 0.01
    moved = replace(
        group.measurement, measured_camera_from_target=group.measurement.measured_camera_from_target @ SE3.exp(shift)
    )
    found = solve_packed(problem, made.cell)
    square = studentized(problem.with_groups([replace(group, measurement=moved)]), found.state)[0].value[4]
    assert abs(np.sqrt(square) - 10) < 4


def test_scale_is_that_of_the_bulk():
    """With three tenths of the squares gross, an unstated variance of 9 is found within 40 %, and these lie beyond."""
    rng = np.random.default_rng(0)
    value = 9 * rng.chisquare(6, 200)
    value[:60] = 9 * rng.uniform(100, 1000, 60)
    squares = MahalanobisSquared(value, np.full(200, 6))
    scale = robust_scale([squares], 18, stated=False, chance=1e-4)
    assert scale.variance == pytest.approx(9, rel=0.4)
    assert scale.beyond(squares)[:60].all()
    assert not scale.beyond(squares)[60:].any()


def test_stated_sigmas_are_taken_at_their_word():
    """Squares half as large as stated, or a little larger, leave the scale at 1; four times as large do not."""
    rng = np.random.default_rng(1)
    value = rng.chisquare(6, 300)
    variances = [
        robust_scale([MahalanobisSquared(k * value, np.full(300, 6))], 18, True, 1e-4).variance for k in (0.5, 1.5, 4)
    ]
    assert variances[:2] == [1.0, 1.0]
    assert variances[2] == pytest.approx(4, rel=0.4)


@pytest.mark.parametrize("target", ["charuco", "points", "points3d"])
def test_points_not_seen_have_no_deviation(target):
    """No freedoms and no number, while the others of their views have theirs."""
    made = simulate(Scenario(samples=6, target=target), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    seen = group.measurement.seen.copy()
    seen[::2, 1] = False
    weight = np.where(seen, group.measurement.weight, 0.0)
    few = replace(group, measurement=replace(group.measurement, seen=seen, weight=weight, stated=weight))
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    (found,) = studentized_points(leave_one_out(problem.with_groups([few]), state, [np.ones(6)]))
    assert np.isnan(found.value[~seen]).all()
    assert not found.freedoms[~seen].any()
    assert np.isfinite(found.value[seen]).all()
    assert set(found.freedoms[seen].tolist()) == {3 if target == "points3d" else 2}


@pytest.mark.parametrize("count", [2, 3, 9])
def test_a_view_is_off_from_the_mean_of_the_others(count):
    """Of poses of one mount: by the square of that over both variances, whatever of its own it brought."""
    sigma = 1e-6 * np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    errors = sigma * np.random.default_rng(count).standard_normal((count, 6))
    problem, state = pose_problem(errors, sigma)
    state = bundle_adjust(problem, state, 1).state
    (found,) = studentized_views(leave_one_out(problem, state, [np.ones(len(problem.groups[0]))]))
    others = (errors.sum(0) - errors) / (count - 1)
    expected = np.sum((errors - others) ** 2 / (sigma**2 * (1 + 1 / (count - 1))), axis=-1)
    np.testing.assert_allclose(found.value, expected, rtol=1e-3)
    assert found.freedoms.tolist() == [6] * count


def test_a_view_that_alone_tells_an_unknown_has_no_freedoms():
    """Nothing else predicts it, and it has no deviation; of a direction that it alone tells it has one less."""
    problem, state = pose_problem(np.full((1, 6), 1e-3), np.ones(6))
    (found,) = studentized_views(leave_one_out(problem, state, [np.ones(len(problem.groups[0]))]))
    assert found.freedoms.tolist() == [0]
    assert np.isnan(found.value).all()
    problem, state = pose_problem(np.full((3, 6), 1e-6), np.ones(6))
    (group,) = problem.groups
    weight = np.ones((3, 6))
    weight[1:, 4] = 0.0  # only the first view tells this turn
    one = problem.with_groups([replace(group, measurement=replace(group.measurement, weight=weight))])
    (found,) = studentized_views(leave_one_out(one, state, [np.ones(3)]))
    assert found.freedoms.tolist() == [5, 5, 5]


@pytest.mark.parametrize(("count", "own"), [(11, False), (12, True)])
def test_twelve_points_judge_each_other(count, own):
    """With fewer, all else does."""
    made = simulate(Scenario(samples=4), 0)
    (group,) = build_problem(made.cell, made.recording)[0].groups
    seen = np.zeros_like(group.measurement.seen)
    seen[:, :count] = True
    assert judged_by_view(replace(group.measurement, seen=seen)).tolist() == [own] * 4
    poses = simulate(Scenario(samples=4, target="pose"), 0)
    (group,) = build_problem(poses.cell, poses.recording)[0].groups
    assert not judged_by_view(group.measurement).any()


def test_points_of_a_view_that_is_not_in_the_fit_are_judged_too():
    """By the state alone where its robots are exact: a point's square is that of its residual over its sigma."""
    made = simulate(Scenario(samples=8, target="points"), 1)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    out = np.where(np.arange(8) == 3, 0.0, 1.0)
    (found,) = studentized_points(leave_one_out(problem, state, [out]))
    (group,) = problem.groups
    predicted = state.camera_from_target(group, problem.stops)
    off = group.measurement.residual_px(predicted, made.cameras["wrist"])[3] / 0.2
    np.testing.assert_allclose(found.value[3], np.sum(off**2, -1), rtol=1e-6)
    assert found.freedoms[3].tolist() == [2] * len(off)
    assert np.all(np.isfinite(found.value))
