"""Deviations are chi-square where the noise is true, and those of one view do not see that view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.jacobians import by_stop_errors, by_unknowns
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
from basecal.estimation.problem.problem import State, chain
from basecal.estimation.solve import solve, solve_from, solve_packed
from basecal.estimation.view.point_jacobians import point_jacobians
from basecal.geometry import SE3
from basecal.geometry.se3_jacobians import right_jacobian_inverse
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


def dense_rows(problem, state):
    """Whitened residuals of views, those of errors of stops behind them, and their derivative to unknowns and errors.

    Written out for poses, each view's six rows by its own sigmas.
    """
    p, k = problem.width, len(problem.stops)
    residuals, rows = [], []
    for group in problem.groups:
        links = chain(group, state, problem.stops)
        error = (group.measurement.measured_camera_from_target.inverse() @ links.camera_from_target).log()
        inner = group.measurement.weight[..., None] * right_jacobian_inverse(error)
        derivative, columns = by_unknowns(problem, group, links, 6)
        full = np.zeros((len(group), 6, p + 6 * k))
        full[..., columns] = inner @ derivative
        for stop, by_error in by_stop_errors(group, links, state, problem.stops, 6):
            for view, number in enumerate(stop):
                full[view, :, p + 6 * number : p + 6 * number + 6] += inner[view] @ by_error[view]
        residuals.append(group.measurement.weight * error)
        rows.append(full)
    return np.concatenate(residuals), np.concatenate(rows)


def held_by_the_others(residuals, rows, width, weights, view):
    """The squared deviation of a view from where all others that count put it: residual and covariance in full."""
    others = (np.arange(len(rows)) != view) & (weights > 0)
    flat = rows[others].reshape(-1, rows.shape[-1])
    told = flat.T @ flat + np.diag((np.arange(rows.shape[-1]) >= width).astype(float))
    step = -np.linalg.solve(told, flat.T @ residuals[others].ravel())
    off = residuals[view] + rows[view] @ step
    return off @ np.linalg.solve(np.eye(6) + rows[view] @ np.linalg.solve(told, rows[view].T), off)


STATIONS = Scenario(samples=12, target="pose", arms="stations", stations=4, robot_noise=(2e-3, 3e-3))


@pytest.mark.parametrize(
    "scenario", [STATIONS, replace(STATIONS, arms="both"), replace(STATIONS, robot_noise=(0.0, 0.0))]
)
@pytest.mark.parametrize("out", [(), (2, 7)])
def test_views_deviate_as_a_fit_of_the_others_says(scenario, out):
    """Written out view by view at the optimum: of those in the fit and of two that are not."""
    made = simulate(scenario, 3)
    problem, _ = build_problem(made.cell, made.recording)
    weights = np.ones(12)
    weights[list(out)] = 0.0
    kept = problem.with_groups(g.take(np.flatnonzero(weights)) for g in problem.groups)
    state = State(made.truth, {}, np.zeros((len(problem.stops), 6)))
    state = at_stops_of(kept, bundle_adjust(kept, state, 1, 50).state)
    found = studentized_views(leave_one_out(problem, state, [weights]))[0]
    residuals, rows = dense_rows(problem, state)
    # Errors of stops are unknowns whose residuals are what they are at the state.
    residuals = residuals - rows[..., problem.width :] @ state.stop_errors.ravel()
    expected = [held_by_the_others(residuals, rows, problem.width, weights, view) for view in range(12)]
    np.testing.assert_allclose(found.value, expected, rtol=1e-4)
    assert set(found.freedoms.tolist()) == {6}


def test_shared_stops_deviate_by_what_views_tell_of_them():
    """Their errors by the variance that views take from what was stated, of the joint covariance written out."""
    made = simulate(STATIONS, 3)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, {}, np.zeros((len(problem.stops), 6)))
    state = bundle_adjust(problem, state, 1, 50).state
    found = studentized_stops(leave_one_out(problem, state, [np.ones(12)]))
    _, rows = dense_rows(problem, state)
    flat = rows.reshape(-1, rows.shape[-1])
    own = np.diag((np.arange(flat.shape[1]) >= problem.width).astype(float))
    covariance = np.linalg.inv(flat.T @ flat + own)[problem.width :, problem.width :].reshape(
        -1, 6, len(own) - problem.width
    )
    shared = np.flatnonzero(problem.shared_stops >= 0)
    assert len(shared) == 4
    for stop in range(len(problem.stops)):
        if stop not in shared:
            assert np.isnan(found.value[stop])
            assert found.freedoms[stop] == 0
            continue
        values, vectors = np.linalg.eigh(np.eye(6) - covariance[stop][:, 6 * stop : 6 * stop + 6])
        told = values > 1e-9
        along = vectors.T @ state.stop_errors[stop]
        assert found.freedoms[stop] == told.sum()
        assert found.value[stop] == pytest.approx(np.sum(along[told] ** 2 / values[told]), rel=1e-4)


@pytest.mark.parametrize("arms", ["both", "stations"])
def test_points_of_small_targets_deviate_as_all_else_says(arms):
    """Each point's residual at the optimum by its covariance: what noise leaves of it about the whole fit."""
    made = simulate(Scenario(samples=8, target="points", arms=arms, stations=4, robot_noise=(2e-3, 3e-3)), 3)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    state = bundle_adjust(problem, state, 1, 50).state
    (group,) = problem.groups
    (found,) = studentized_points(leave_one_out(problem, state, [np.ones(8)]))
    links = chain(group, state, problem.stops)
    points = point_jacobians(group.measurement, links.camera_from_target, state.cameras["wrist"], False)
    p, k = problem.width, len(problem.stops)
    derivative, columns = by_unknowns(problem, group, links, 6)
    full = np.zeros((8, 6, p + 6 * k))
    full[..., columns] = derivative
    for stop, by_error in by_stop_errors(group, links, state, problem.stops, 6):
        for view, number in enumerate(stop):
            full[view, :, p + 6 * number : p + 6 * number + 6] += by_error[view]
    rows = points.jacobian[..., :6] @ full[:, None]
    flat = rows.reshape(-1, rows.shape[-1])
    spread = np.linalg.inv(flat.T @ flat + np.diag((np.arange(p + 6 * k) >= p).astype(float)))
    left = np.eye(2) - rows @ spread @ rows.mT
    expected = (points.residual[..., None, :] @ np.linalg.solve(left, points.residual[..., None]))[..., 0, 0]
    assert not judged_by_view(group.measurement).any()
    np.testing.assert_allclose(found.value, expected, rtol=1e-6)


@pytest.mark.parametrize(("points", "by_view"), [(11, False), (12, True)])
def test_from_twelve_points_on_a_view_judges_its_own(points, by_view):
    """Of fewer all else judges them, too."""
    made = simulate(Scenario(samples=3), 0)
    (group,) = build_problem(made.cell, made.recording)[0].groups
    seen = np.zeros_like(group.measurement.seen)
    seen[:2, :points] = seen[2, :1] = True
    assert judged_by_view(replace(group.measurement, seen=seen)).tolist() == [by_view, by_view, False]
