"""Tests of chi-square distances of views, points and stops, leaving each view out of its own prediction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.ends import with_eye
from tests.pose_problem import pose_problem

from basecal.cell import Intrinsics, Unknown
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.jacobians import stop_error_jacobians, unknown_jacobian
from basecal.estimation.least_squares.studentized_residuals import (
    _studentize,
    judged_by_view,
    leave_one_out,
    studentized_points,
    studentized_stops,
    studentized_views,
    view_misfits,
)
from basecal.estimation.outliers.inlier_mask import all_inliers, without_unseen_stops
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State, chain
from basecal.estimation.solve import solve
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.target_points import point_jacobians
from basecal.geometry import SE3, Camera
from basecal.geometry.se3_jacobians import right_jacobian_inverse
from basecal.simulation import Scenario, simulate

NOISY = (3e-4, 5e-4)


def solve_and_leave_one_out(scenario, seed):
    made = simulate(scenario, seed)
    found = solve(made.cell, made.recording)
    return leave_one_out(found.problem, found.state, all_inliers(found.problem).weights)


def squares_per_freedom(squares) -> np.ndarray:
    return np.concatenate([s.value[s.freedoms > 0] / s.freedoms[s.freedoms > 0] for s in squares])


@pytest.mark.journey
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
def test_view_distances_are_chi_square(scenario, freedoms):
    """The mean of d^2 / freedoms over five cells is 1 within five standard errors of independent views."""
    every = [s for seed in range(5) for s in studentized_views(solve_and_leave_one_out(scenario, seed))]
    assert {int(f) for s in every for f in s.freedoms} == {freedoms}
    mean = squares_per_freedom(every)
    assert abs(mean.mean() - 1) < 5 * np.sqrt(2 / freedoms / len(mean))


@pytest.mark.parametrize("target", ["charuco", "points", "points3d"])
def test_point_distances_are_chi_square(target):
    """Points are predicted by their view or by all else, with mean 1 within five standard errors."""
    every = [
        s
        for seed in range(4)
        for s in studentized_points(solve_and_leave_one_out(Scenario(target=target, robot_noise=NOISY), seed))
    ]
    mean = squares_per_freedom(every)
    assert abs(mean.mean() - 1) < 5 * np.sqrt(2 / every[0].freedoms.max() / len(mean))


@pytest.mark.journey
def test_shared_stop_distances_are_chi_square():
    """Errors of stops shared by several views have mean 1 within five standard errors.

    Each has fewer than six freedoms.
    """
    mean = squares_per_freedom(
        [
            studentized_stops(solve_and_leave_one_out(Scenario(arms="stations", robot_noise=NOISY), seed))
            for seed in range(8)
        ]
    )
    assert len(mean) == 40
    assert abs(mean.mean() - 1) < 5 * np.sqrt(2 / 4 / len(mean))


@pytest.mark.parametrize("target", ["charuco", "points", "points3d"])
def test_unseen_points_have_no_distance(target):
    """Unseen points have no freedoms and NaN, and the other points of their views have values."""
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
def test_view_distance_is_to_the_mean_of_the_others(count):
    """For poses of one mount, it is the squared deviation over both variances, without the view's own contribution."""
    sigma = 1e-6 * np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    errors = sigma * np.random.default_rng(count).standard_normal((count, 6))
    problem, state = pose_problem(errors, sigma)
    state = bundle_adjust(problem, state, 1).state
    (found,) = studentized_views(leave_one_out(problem, state, [np.ones(len(problem.groups[0]))]))
    others = (errors.sum(0) - errors) / (count - 1)
    expected = np.sum((errors - others) ** 2 / (sigma**2 * (1 + 1 / (count - 1))), axis=-1)
    np.testing.assert_allclose(found.value, expected, rtol=1e-3)
    assert found.freedoms.tolist() == [6] * count


def test_sole_view_of_an_unknown_has_no_freedoms():
    """No other view predicts it, so it has no distance. A direction that only this view observes costs one freedom."""
    problem, state = pose_problem(np.full((1, 6), 1e-3), np.ones(6))
    (found,) = studentized_views(leave_one_out(problem, state, [np.ones(len(problem.groups[0]))]))
    assert found.freedoms.tolist() == [0]
    assert np.isnan(found.value).all()
    problem, state = pose_problem(np.full((3, 6), 1e-6), np.ones(6))
    (group,) = problem.groups
    weight = np.ones((3, 6))
    weight[1:, 4] = 0.0  # only the first view observes this rotation
    one = problem.with_groups([replace(group, measurement=replace(group.measurement, weight=weight))])
    (found,) = studentized_views(leave_one_out(one, state, [np.ones(3)]))
    assert found.freedoms.tolist() == [5, 5, 5]


@pytest.mark.parametrize(("count", "own"), [(11, False), (12, True)])
def test_twelve_points_are_judged_by_their_own_view(count, own):
    """With fewer points, all other data are used. Measured poses have no points."""
    made = simulate(Scenario(samples=4), 0)
    (group,) = build_problem(made.cell, made.recording)[0].groups
    seen = np.zeros_like(group.measurement.seen)
    seen[:, :count] = True
    seen[2, 1:] = False
    assert judged_by_view(replace(group.measurement, seen=seen)).tolist() == [own, own, False, own]
    problem, _ = pose_problem(np.zeros((2, 6)), np.ones(6))
    assert judged_by_view(problem.groups[0].measurement).tolist() == [False, False]


def test_points_of_excluded_views_are_judged():
    """With exact robots the state alone is used: a point's square is its residual over its sigma."""
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
    """Whitened residuals of pose views, and their derivatives by unknowns and stop errors."""
    p, k = problem.width, len(problem.stops)
    residuals, rows = [], []
    for group in problem.groups:
        links = chain(group, state, problem.stops)
        error = (group.measurement.measured_camera_from_target.inverse() @ links.camera_from_target).log()
        inner = group.measurement.weight[..., None] * right_jacobian_inverse(error)
        derivative, columns = unknown_jacobian(problem, group, links, state, 6)
        full = np.zeros((len(group), 6, p + 6 * k))
        full[..., columns] = inner @ derivative
        for stop, by_error in stop_error_jacobians(group, links, state, problem.stops, 6):
            for view, number in enumerate(stop):
                full[view, :, p + 6 * number : p + 6 * number + 6] += inner[view] @ by_error[view]
        residuals.append(group.measurement.weight * error)
        rows.append(full)
    return np.concatenate(residuals), np.concatenate(rows)


def distance_from_refit(residuals, rows, width, weights, view):
    """The squared distance of a view from the prediction of all other views in the fit, with full covariance."""
    others = (np.arange(len(rows)) != view) & (weights > 0)
    flat = rows[others].reshape(-1, rows.shape[-1])
    information = flat.T @ flat + np.diag((np.arange(rows.shape[-1]) >= width).astype(float))
    step = -np.linalg.solve(information, flat.T @ residuals[others].ravel())
    off = residuals[view] + rows[view] @ step
    return off @ np.linalg.solve(np.eye(6) + rows[view] @ np.linalg.solve(information, rows[view].T), off)


STATIONS = Scenario(samples=12, target="pose", arms="stations", stations=4, robot_noise=(2e-3, 3e-3))


@pytest.mark.parametrize(
    "scenario", [STATIONS, replace(STATIONS, arms="both"), replace(STATIONS, robot_noise=(0.0, 0.0))]
)
@pytest.mark.parametrize("out", [(), (2, 7)])
def test_view_distances_equal_explicit_refits(scenario, out):
    """The result equals a computation view by view at the optimum, for views in the fit and for two that are not."""
    made = simulate(scenario, 3)
    problem, _ = build_problem(made.cell, made.recording)
    weights = np.ones(12)
    weights[list(out)] = 0.0
    kept = problem.with_groups(g.take(np.flatnonzero(weights)) for g in problem.groups)
    state = State(made.truth, {}, np.zeros((len(problem.stops), 6)))
    state = without_unseen_stops(kept, bundle_adjust(kept, state, 1, 50).state)
    found = studentized_views(leave_one_out(problem, state, [weights]))[0]
    residuals, rows = dense_rows(problem, state)
    # Stop errors are unknowns whose residuals are their values at the state.
    residuals = residuals - rows[..., problem.width :] @ state.stop_errors.ravel()
    expected = [distance_from_refit(residuals, rows, problem.width, weights, view) for view in range(12)]
    np.testing.assert_allclose(found.value, expected, rtol=1e-4)
    assert set(found.freedoms.tolist()) == {6}


def test_shared_stop_distances_use_the_explained_variance():
    """Errors are divided by the variance that views remove from the stated one, by the full joint covariance."""
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
        informative = values > 1e-9
        along = vectors.T @ state.stop_errors[stop]
        assert found.freedoms[stop] == informative.sum()
        assert found.value[stop] == pytest.approx(np.sum(along[informative] ** 2 / values[informative]), rel=1e-4)


@pytest.mark.parametrize("arms", ["both", "stations"])
def test_points_of_small_targets_use_the_whole_fit(arms):
    """Each point's residual at the optimum is divided by its covariance after the whole fit."""
    made = simulate(Scenario(samples=8, target="points", arms=arms, stations=4, robot_noise=(2e-3, 3e-3)), 3)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    state = bundle_adjust(problem, state, 1, 50).state
    (group,) = problem.groups
    (found,) = studentized_points(leave_one_out(problem, state, [np.ones(8)]))
    links = chain(group, state, problem.stops)
    points = point_jacobians(group.measurement, links.camera_from_target, state.cameras["wrist"], False)
    p, k = problem.width, len(problem.stops)
    derivative, columns = unknown_jacobian(problem, group, links, state, 6)
    full = np.zeros((8, 6, p + 6 * k))
    full[..., columns] = derivative
    for stop, by_error in stop_error_jacobians(group, links, state, problem.stops, 6):
        for view, number in enumerate(stop):
            full[view, :, p + 6 * number : p + 6 * number + 6] += by_error[view]
    rows = points.jacobian[..., :6] @ full[:, None]
    flat = rows.reshape(-1, rows.shape[-1])
    spread = np.linalg.inv(flat.T @ flat + np.diag((np.arange(p + 6 * k) >= p).astype(float)))
    left = np.eye(2) - rows @ spread @ rows.mT
    expected = (points.residual[..., None, :] @ np.linalg.solve(left, points.residual[..., None]))[..., 0, 0]
    assert not judged_by_view(group.measurement).any()
    np.testing.assert_allclose(found.value, expected, rtol=1e-6)


@pytest.mark.parametrize("batch", [(), (2,)])
def test_view_misfits_are_in_sigmas(batch):
    """Near the identity they are the squared pose errors in sigmas, and a non-finite view is infinitely far."""
    sigma = 1e-6 * np.arange(1.0, 7.0)
    errors = np.array([[1.0, -2, 0, 0, 3, 0], [0, 0, 0, 1, 0, 1], [1, 0, 0, 0, 0, 0]]) * sigma
    problem, state = pose_problem(errors, sigma)
    problem.groups[0].measurement.weight[2] = np.inf
    with np.errstate(invalid="ignore"):
        (found,) = view_misfits(problem, state.repeat(problem, 2) if batch else state)
    np.testing.assert_allclose(found.value, np.broadcast_to([14.0, 2.0, np.inf], (*batch, 3)), rtol=1e-5)
    np.testing.assert_array_equal(found.freedoms, np.full((*batch, 3), 6))


def led_problem(points, free_lens=False):
    """Views of a target at 1, 0.5, 0 and -1 m, each point 3 px and 4 px off its prediction."""
    problem, state = pose_problem(np.zeros((4, 6)), None)
    (group,) = problem.groups
    lens = Camera("pinhole", [1000.0, 1000.0, 500.0, 500.0])
    at = np.array([[0.0, 0.0, z] for z in (1.0, 0.5, 0.0, -1.0)])
    pixels = lens.project(points + np.abs(at + np.array([0, 0, 1e-9]))[:, None]) + np.array([3.0, 4.0])
    seen = np.ones(pixels.shape[:2], dtype=bool)
    views = PixelMeasurement(points, np.nan_to_num(pixels), seen, seen / 2.0, seen / 2.0)
    flanges = SE3(np.tile(np.eye(3), (4, 1, 1)), -at)
    problem = problem.with_groups([with_eye(replace(group, measurement=views), base_from_flange=flanges)])
    if free_lens:
        problem = replace(problem, columns={**problem.columns, "camera": slice(6, 10)})
        problem = replace(problem, lenses={"camera": Intrinsics("fixed", lens)})
    return problem, replace(state, cameras={"camera": lens})


def test_led_misfit_is_infinite_behind_the_camera():
    """The misfit of an LED view is in pixels, and infinite from the camera's own position on.

    It has as many freedoms as equations.
    """
    problem, state = led_problem(np.array([[0.0, 0.0, 0.0]]))
    (found,) = view_misfits(problem, state)
    np.testing.assert_allclose(found.value, [25 / 4, 25 / 4, np.inf, np.inf], rtol=1e-9)
    assert found.freedoms.tolist() == [2, 2, 2, 2]


@pytest.mark.parametrize(("share", "freedoms"), [(1.5e-4, 6), (0.7e-4, 0)])
def test_view_is_judged_if_others_contribute_enough(share, freedoms):
    """The others need 1e-4 of all information, else the view has no prediction."""
    errors = np.array([[1e-6] * 6, [-1e-6] * 6])
    problem, state = pose_problem(errors, np.ones(6))
    problem.groups[0].measurement.weight[1] = np.sqrt(share / (1 - share))
    (found,) = studentized_views(leave_one_out(problem, state, [np.ones(2)]))
    assert found.freedoms.tolist() == [freedoms, 6]
    assert np.isfinite(found.value).tolist() == [freedoms > 0, True]


def test_view_of_one_coordinate_has_one_freedom():
    """The squared error along the only coordinate is relative to the other view and divided by the variance of both."""
    problem, state = pose_problem(np.array([[3e-6] * 6, [1e-6] * 6]), np.full(6, 1e-6))
    problem.groups[0].measurement.weight[0, 1:] = 0.0
    state = bundle_adjust(problem, state, 1).state
    (found,) = studentized_views(leave_one_out(problem, state, [np.ones(2)]))
    assert found.freedoms.tolist() == [1, 1]
    np.testing.assert_allclose(found.value, 4 / 2, rtol=1e-4)


@pytest.mark.parametrize(("learnt", "freedoms"), [(0.5, 1), (3e-9, 1), (0.5e-9, 0), (0.0, 0)])
def test_shared_stop_is_judged_if_views_explain_a_billionth(learnt, freedoms):
    """A stop is judged along directions with at least 1e-9 of the variance explained.

    Its squared error is divided by the explained part.
    """
    tight = Unknown("prior", SE3.identity(), np.full(6, 1e-20))
    problem, state = pose_problem(np.zeros((3, 6)), np.full(6, 1e-3), tight, np.full(6, 1e-3))
    (group,) = problem.groups
    group.measurement.weight[:] = 0.0
    group.measurement.weight[:2, 0] = 1e3 * np.sqrt(learnt / (1 - learnt) / 2)
    problem = problem.with_groups([with_eye(group, stop=np.array([1, 1, 0]))])
    error = np.array([0.0, 2e-5, 0.0])[:, None] * np.ones(6)
    found = studentized_stops(leave_one_out(problem, replace(state, stop_errors=error), [np.ones(3)]))
    assert found.freedoms.tolist() == [0, freedoms, 0]
    np.testing.assert_allclose(found.value, [np.nan, 4e-10 / learnt if freedoms else np.nan, np.nan], rtol=1e-4)


def test_poses_and_single_points_have_no_point_distances():
    """Poses and single points have no freedoms and a distance of NaN, but two points of a view have values."""
    problem, state = pose_problem(np.zeros((3, 6)), np.ones(6))
    (found,) = studentized_points(leave_one_out(problem, state, [np.ones(3)]))
    for points, shape in ((None, (3, 1)), (np.zeros((1, 3)), (4, 1)), (np.array([[0, 0, 0], [0.1, 0, 0]]), (4, 2))):
        if points is not None:
            problem, state = led_problem(points)
        (found,) = studentized_points(leave_one_out(problem, state, [np.zeros(shape[0])]))
        assert found.value.shape == found.freedoms.shape == shape
        assert np.isnan(found.value[:2]).all() == (shape[1] == 1)
        assert bool(found.freedoms[:2].any()) == (shape[1] == 2)


@pytest.mark.parametrize("free_lens", [False, True])
def test_points_of_a_full_view_use_its_own_pose(free_lens):
    """Each residual is relative to a pose fitted to its view alone, whatever the lens. Other views use all else."""
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (14, 3))
    problem, state = led_problem(points, free_lens)
    (group,) = (g.take(np.array([0, 1])) for g in problem.groups)
    noise = np.random.default_rng(1).standard_normal(group.measurement.pixels.shape)
    seen = np.arange(14) < np.array([[14], [11]])
    views = replace(group.measurement, pixels=group.measurement.pixels + noise, seen=seen, weight=seen / 2.0)
    problem = problem.with_groups([replace(group, measurement=views)])
    about = leave_one_out(problem, state, [np.ones(2)])
    (found,) = studentized_points(about)
    rows = point_jacobians(views, state.camera_from_target(group, problem.stops), state.cameras["camera"], False)
    of_pose, residual = rows.jacobian[0].reshape(28, 6), rows.residual[0].ravel()
    hat = of_pose @ np.linalg.solve(of_pose.T @ of_pose, of_pose.T)
    off = (residual - hat @ residual).reshape(14, 2)
    left = [np.linalg.inv((np.eye(28) - hat)[k : k + 2, k : k + 2]) for k in range(0, 28, 2)]
    np.testing.assert_allclose(found.value[0], [r @ inverse @ r for r, inverse in zip(off, left, strict=True)])
    few = problem.with_groups([replace(group, measurement=replace(views, seen=seen & seen[1]))])
    (by_all_else,) = studentized_points(replace(about, problem=few))
    np.testing.assert_allclose(found.value[1], by_all_else.value[1])


@pytest.mark.parametrize(("left", "value", "freedoms"), [
    ([0.5, 0.8], 1 / 0.5 + 4 / 0.8, 2),
    ([0.9, 2e-3], 1 / 0.9 + 4 / 2e-3, 2),
    ([0.9, 0.5e-3], 1 / 0.9, 1),
    ([0.5e-3, 0.9], 4 / 0.9, 1),
    ([0.5e-3, 1e-4], np.nan, 0),
    ([-1.0, -2.0], np.nan, 0),
    ([0.5, 0.8, 0.4], 1 / 0.5 + 4 / 0.8 + 9 / 0.4, 3),
    ([2e-3, 0.8, 0.5e-3], 1 / 2e-3 + 4 / 0.8, 2),
])  # fmt: skip
@pytest.mark.parametrize("turn_rad", [0.0, 0.7, -0.7])
def test_point_counts_if_a_thousandth_of_its_noise_remains(left, value, freedoms, turn_rad):
    """Each direction counts by its remaining noise, for any rotation of these directions.

    Unseen points do not count.
    """
    d = len(left)
    turn = np.eye(d)
    turn[:2, :2] = [[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]]
    residual = np.tile(turn @ np.array([1.0, 2.0, 3.0])[:d], (1, 2, 1))
    jacobian = np.tile(turn @ np.diag(np.sqrt(1 - np.array(left))), (1, 2, 1, 1))
    found = _studentize(residual, jacobian, np.eye(d)[None], np.array([[True, False]]))
    np.testing.assert_allclose(found.value, [[value, np.nan]])
    assert found.freedoms.tolist() == [[freedoms, 0]]
