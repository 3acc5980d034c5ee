"""The restricted likelihood of sigmas, against the dense formula and against differences."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from basecal.estimation.least_squares.jacobians import by_stop_errors, by_unknowns
from basecal.estimation.noise.mixed_model import Moments, mixed_model, open_jitter
from basecal.estimation.noise.reml import columns_given, posterior, sigma_count
from basecal.estimation.noise.robot_noise import stops_made, with_robot_noise, without_errors
from basecal.estimation.noise.terms.common_errors import CommonErrors
from basecal.estimation.noise.view_estimates import STATED
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State, chain
from basecal.geometry.se3_jacobians import right_jacobian_inverse
from basecal.simulation import Scenario, simulate

ROBOTS = ("eye", "hand")
NOISY = Scenario(samples=8, robot_noise=(1e-3, 2e-3), state_robot_noise=False)


def at_truth(scenario, seed=1):
    """A problem whose stops have unit sigmas, and the truth, its stops without errors."""
    s = simulate(scenario, seed)
    problem, _ = build_problem(s.cell, s.recording)
    unit = with_robot_noise(problem, dict.fromkeys(ROBOTS, np.ones(6)))
    return unit, without_errors(unit, State(s.truth, s.cameras if problem.lenses else {}, np.zeros((0, 6))))


def dense_model(problem, state, logs):
    """Residuals r, their derivative X to the unknowns, V of views and stops, and its derivatives to the logarithms."""
    (group,) = problem.groups
    links = chain(group, state, problem.stops)
    error = (group.measurement.measured_camera_from_target.inverse() @ links.camera_from_target).log()
    inner = right_jacobian_inverse(error)
    n = len(group)
    by_x, columns = by_unknowns(problem, group, links, 6)
    x = np.zeros((6 * n, problem.width))
    x[:, columns] = (inner @ by_x).reshape(6 * n, -1)
    z = np.zeros((n, 6, len(problem.stops), 6))
    for stop, by_error in by_stop_errors(group, links, state, problem.stops, 6):
        z[np.arange(n), :, stop] += inner @ by_error
    sigma = {robot: np.repeat(np.exp(logs[2 * i : 2 + 2 * i]), 3) for i, robot in enumerate(ROBOTS)}
    z = (z * np.array([sigma[robot] for robot in problem.stops.robot]).reshape(-1, 6)).reshape(
        6 * n, len(problem.stops) * 6
    )
    v = np.diag(group.measurement.weight.ravel() ** -2.0) + z @ z.T
    of = np.array([2 * ROBOTS.index(robot) + np.repeat([0, 1], 3) for robot in problem.stops.robot]).ravel()
    return error.ravel(), x, v, [2 * z[:, of == k] @ z[:, of == k].T for k in range(2 * len(ROBOTS))]


def dense_surprise(problem, state, logs):
    """log|V| + log|X'V^-1 X| + r'P r, with V of views and stops written out in full."""
    error, x, v, _ = dense_model(problem, state, logs)
    vx, vr = np.linalg.solve(v, x), np.linalg.solve(v, error)
    information = x.T @ vx
    explained = (x.T @ vr) @ np.linalg.solve(information, x.T @ vr)
    return np.linalg.slogdet(v)[1] + np.linalg.slogdet(information)[1] + error @ vr - explained


@pytest.mark.parametrize("arms", ["both", "stations", "halves"])
def test_average_information_is_that_of_the_dense_formula(arms):
    """It is r'P V_i P V_j P r of all residuals and stops written out, Gilmour, Thompson & Cullis 1995, (7)."""
    problem, state = at_truth(replace(NOISY, target="pose", arms=arms, camera_mount="fixed"))
    model = mixed_model(problem, state, ROBOTS)
    logs = np.log([1e-3, 2e-3, 5e-4, 1e-3])
    error, x, v, slopes = dense_model(problem, state, logs)
    inverse = np.linalg.inv(v)
    projected = inverse - inverse @ x @ np.linalg.solve(x.T @ inverse @ x, x.T @ inverse)
    working = np.array([each @ projected @ error for each in slopes])
    dense = working @ projected @ working.T
    np.testing.assert_allclose(posterior(model, logs).average_information(), dense, rtol=1e-5, atol=1e-6 * dense.max())


@pytest.mark.parametrize("arms", ["both", "stations", "halves"])
def test_value_is_that_of_the_dense_formula(arms):
    """Between sigmas it changes as the restricted likelihood of all residuals and stops written out."""
    problem, state = at_truth(replace(NOISY, target="pose", arms=arms, camera_mount="fixed"))
    model = mixed_model(problem, state, ROBOTS)
    rows = np.log([[1e-3, 2e-3, 1e-3, 2e-3], [3e-3, 1e-3, 5e-4, 4e-3]])
    ours = [posterior(model, logs).value for logs in rows]
    dense = [dense_surprise(problem, state, logs) for logs in rows]
    assert ours[1] - ours[0] == pytest.approx(dense[1] - dense[0], abs=1e-3)
    assert abs(dense[1] - dense[0]) > 1


@pytest.mark.parametrize("arms", ["both", "halves", "stations"])
@pytest.mark.parametrize("smooth", [False, True])
def test_slope_is_the_derivative(arms, smooth):
    """Of views, robots and smooth errors alike, the slope agrees with central differences to 1e-3."""
    problem, state = at_truth(replace(NOISY, arms=arms, intrinsics="free", state_pixel_noise=False))
    rng = np.random.default_rng(0)
    state = replace(state, stop_errors=1e-3 * rng.standard_normal(state.stop_errors.shape))
    modes = {robot: rng.standard_normal((stops_made(problem, robot), 2)) for robot in ROBOTS} if smooth else {}
    shared = {robot: CommonErrors.in_every_coordinate(of) for robot, of in modes.items()}
    model = mixed_model(problem, state, ROBOTS, shared)
    logs = np.log([0.3, *[1e-3, 2e-3] * (4 if smooth else 2)]) + 0.2 * rng.standard_normal(sigma_count(model))
    steps = 1e-4 * np.eye(len(logs))
    differences = [(posterior(model, logs + h).value - posterior(model, logs - h).value) / 2e-4 for h in steps]
    np.testing.assert_allclose(posterior(model, logs).slope(), differences, rtol=1e-3, atol=1e-3)


def test_blocks_at_a_time_change_nothing(monkeypatch):
    """Taken one by one, blocks give what they give together: value, slope, means and covariance."""
    problem, state = at_truth(replace(NOISY, arms="halves", state_pixel_noise=False))
    model = mixed_model(problem, state, ROBOTS)
    logs = np.log([0.3, 1e-3, 2e-3, 1e-3, 2e-3])
    together = posterior(model, logs)
    slope = together.slope()
    monkeypatch.setattr("basecal.estimation.noise.mixed_model._AT_ONCE", 1)
    apart = posterior(model, logs)
    assert model.layout.blocks > 2
    assert apart.value == pytest.approx(together.value, rel=1e-11)
    np.testing.assert_allclose(apart.slope(), slope, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(apart.mean_errors, together.mean_errors, rtol=1e-8, atol=1e-12)
    rounding = 1e-9 * np.abs(together.covariance).max()  # of entries that are differences of larger ones
    np.testing.assert_allclose(apart.covariance, together.covariance, rtol=1e-8, atol=rounding)


@pytest.mark.parametrize("arms", ["both", "halves", "stations"])
def test_columns_alone_are_those_of_the_whole(arms):
    """Without the errors in blocks the columns are as with them, to the last bit."""
    problem, state = at_truth(replace(NOISY, arms=arms, state_pixel_noise=False))
    model, logs = mixed_model(problem, state, ROBOTS), np.log([0.3, 1e-3, 2e-3, 1e-3, 2e-3])
    whole, alone = posterior(model, logs), columns_given(model, logs)
    assert alone.value == whole.value
    np.testing.assert_array_equal(alone.step, whole.step)
    np.testing.assert_array_equal(alone.covariance, whole.covariance)


@pytest.mark.parametrize("arms", ["both", "stations"])
def test_sums_over_blocks_are_those_of_block_by_block(arms):
    """Where all goes by one part the slope is that of cutting it in two alike, which the general way takes."""
    problem, state = at_truth(replace(NOISY, target="chessboard", arms=arms, state_pixel_noise=False))
    model = mixed_model(problem, state, ROBOTS)
    ((camera, name),) = model.parts
    half = {f.name: 0.5 * getattr(model.parts[camera, name], f.name) for f in fields(Moments)}
    stated = {(camera, name): Moments(**half), (camera, STATED): Moments(**half)}
    logs = np.log([1.0, 1e-3, 2e-3, 5e-4, 1e-3])  # at 1 px both halves weigh alike
    whole, cut = posterior(model, logs), posterior(replace(model, parts=stated), logs)
    np.testing.assert_allclose(whole.value - cut.value, 0, atol=1e-8 * abs(whole.value))
    np.testing.assert_allclose(cut.slope()[1:], whole.slope()[1:], rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(2 * cut.slope()[0], whole.slope()[0], rtol=1e-8)


@pytest.mark.parametrize("is_open", [True, False, None])
@pytest.mark.parametrize("exact", [(), ("eye", "hand")])
def test_stamps_that_jitter_are_noise_along_the_motion(is_open, exact):
    """As dense: each view's own, by a sigma that is open or known, beside noise of arms or of exact ones.

    Views that move by stamps that do not jitter are as any.
    """
    robots = tuple(robot for robot in ROBOTS if robot not in exact)
    made = simulate(replace(NOISY, target="pose", camera_mount="fixed"), 1)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    motion = np.random.default_rng(5).standard_normal((len(group), 6))
    problem = problem.with_groups([replace(group, motion=motion)])
    if robots:
        problem = with_robot_noise(problem, dict.fromkeys(ROBOTS, np.ones(6)))
    state = without_errors(problem, State(made.truth, {}, np.zeros((0, 6))))
    of_jitter = (
        {"open_jitter": frozenset({"wrist"})} if is_open else {"jitter_s": {"wrist": 0.0 if is_open is None else 2e-3}}
    )
    problem = replace(problem, **of_jitter)
    model = mixed_model(problem, state, robots)
    assert model.shaken == (("wrist",) if is_open else ())
    sigmas = np.log([[1e-3, 2e-3, 5e-4, 1e-3, 2e-3], [3e-3, 1e-3, 5e-4, 4e-3, 1e-3 if is_open else 2e-3]])
    if is_open is None:
        motion = np.zeros_like(motion)
    keep = [*range(4 if robots else 0), *([4] if is_open else [])]
    values = [posterior(model, logs[keep]).value for logs in sigmas]
    dense = [dense_shaken(problem, state, logs[:4] if robots else None, motion * np.exp(logs[4])) for logs in sigmas]
    assert values[1] - values[0] == pytest.approx(dense[1] - dense[0], abs=1e-3)
    assert abs(dense[1] - dense[0]) > 0.5 or not keep
    step, covariance = dense_answer(problem, state, sigmas[0][:4] if robots else None, motion * np.exp(sigmas[0][4]))
    found = posterior(model, sigmas[0][keep])
    np.testing.assert_allclose(found.step, step, atol=1e-6)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-3, atol=1e-10)


def shaken_model(problem, state, logs, shake):
    """Residuals, derivative and covariance: views shaken along (n, 6), arms as `logs` say, or exact."""
    error, x, v, _ = dense_model(problem, state, np.zeros(4) if logs is None else logs)
    inner = right_jacobian_inverse(error.reshape(-1, 6))
    z = (inner @ shake[..., None])[..., 0]
    for k, each in enumerate(z):
        v[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] += np.outer(each, each)
    return error, x, v


def dense_shaken(problem, state, logs, shake):
    error, x, v = shaken_model(problem, state, logs, shake)
    information = x.T @ np.linalg.solve(v, x)
    explained = (x.T @ np.linalg.solve(v, error)) @ np.linalg.solve(information, x.T @ np.linalg.solve(v, error))
    value = np.linalg.slogdet(v)[1] + np.linalg.slogdet(information)[1]
    return value + error @ np.linalg.solve(v, error) - explained


def dense_answer(problem, state, logs, shake):
    """The generalised least-squares step, and its covariance."""
    error, x, v = shaken_model(problem, state, logs, shake)
    covariance = np.linalg.inv(x.T @ np.linalg.solve(v, x))
    return -covariance @ (x.T @ np.linalg.solve(v, error)), covariance


def test_jitter_of_views_that_do_not_move_is_not_open():
    """Nothing tells it."""
    problem, state = at_truth(replace(NOISY, target="pose", camera_mount="fixed"))
    problem = replace(problem, open_jitter=frozenset({"wrist"}))
    assert open_jitter(problem) == ()
    (group,) = problem.groups
    moving = replace(group, motion=np.ones((len(group), 6)))
    assert open_jitter(problem.with_groups([moving])) == ("wrist",)
    assert open_jitter(problem.with_groups([moving.take(np.zeros(0, dtype=int))])) == ()
    assert open_jitter(replace(problem.with_groups([moving]), open_jitter=frozenset())) == ()
    assert mixed_model(problem, state, ROBOTS).shaken == ()
