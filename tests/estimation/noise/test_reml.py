"""Tests of the restricted likelihood of sigmas, against the dense formula and finite differences."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from tests.made_up_model import ALL_STATED, BLOCKS, COLUMNS, OPEN, ROWS, UNKNOWNS, expand_model, made_up
from tests.pose_problem import STAR, two_arm_problem

from basecal.effects.faces.shared_errors import SharedErrors
from basecal.estimation.least_squares.jacobians import stop_error_jacobians, unknown_jacobian
from basecal.estimation.noise.mixed_model import Moments, mixed_model, open_jitter
from basecal.estimation.noise.reml import (
    Equations,
    _rounding_loss,
    _solve,
    node_equations,
    posterior,
    scales,
    solve_columns,
)
from basecal.estimation.noise.robot_noise import count_stops, with_robot_noise, without_errors
from basecal.estimation.noise.view_estimates import STATED
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State, chain
from basecal.geometry.se3_jacobians import right_jacobian_inverse
from basecal.numerics.batch import take
from basecal.simulation import Scenario, simulate

ROBOTS = ("eye", "hand")
NOISY = Scenario(samples=8, robot_noise=(1e-3, 2e-3), state_robot_noise=False)


def problem_at_truth(scenario, seed=1):
    """A problem with unit sigmas of stops, and the true state without stop errors."""
    s = simulate(scenario, seed)
    problem, _ = build_problem(s.cell, s.recording)
    unit = with_robot_noise(problem, dict.fromkeys(ROBOTS, np.ones(6)))
    return unit, without_errors(unit, State(s.truth, s.cameras if problem.lenses else {}, np.zeros((0, 6))))


def dense_model(problem, state, logs):
    """Residuals r, their derivative X by the unknowns, V of views and stops, and its derivatives by the logarithms."""
    (group,) = problem.groups
    links = chain(group, state, problem.stops)
    error = (group.measurement.measured_camera_from_target.inverse() @ links.camera_from_target).log()
    inner = right_jacobian_inverse(error)
    n = len(group)
    by_x, columns = unknown_jacobian(problem, group, links, state, 6)
    x = np.zeros((6 * n, problem.width))
    x[:, columns] = (inner @ by_x).reshape(6 * n, -1)
    z = np.zeros((n, 6, len(problem.stops), 6))
    for stop, by_error in stop_error_jacobians(group, links, state, problem.stops, 6):
        z[np.arange(n), :, stop] += inner @ by_error
    sigma = {robot: np.repeat(np.exp(logs[2 * i : 2 + 2 * i]), 3) for i, robot in enumerate(ROBOTS)}
    z = (z * np.array([sigma[robot] for robot in problem.stops.robot]).reshape(-1, 6)).reshape(
        6 * n, len(problem.stops) * 6
    )
    v = np.diag(group.measurement.weight.ravel() ** -2.0) + z @ z.T
    of = np.array([2 * ROBOTS.index(robot) + np.repeat([0, 1], 3) for robot in problem.stops.robot]).ravel()
    return error.ravel(), x, v, [2 * z[:, of == k] @ z[:, of == k].T for k in range(2 * len(ROBOTS))]


def dense_value(problem, state, logs):
    """log|V| + log|X'V^-1 X| + r'P r, with the full V of views and stops."""
    error, x, v, _ = dense_model(problem, state, logs)
    vx, vr = np.linalg.solve(v, x), np.linalg.solve(v, error)
    information = x.T @ vx
    explained = (x.T @ vr) @ np.linalg.solve(information, x.T @ vr)
    return np.linalg.slogdet(v)[1] + np.linalg.slogdet(information)[1] + error @ vr - explained


@pytest.mark.parametrize("arms", ["both", "stations", "halves"])
def test_average_information_equals_the_dense_formula(arms):
    """The average information is r'P V_i P V_j P r by Gilmour, Thompson & Cullis 1995, (7).

    All residuals and stops are written out.
    """
    problem, state = problem_at_truth(replace(NOISY, target="pose", arms=arms, camera_mount="fixed"))
    model = mixed_model(problem, state, ROBOTS)
    logs = np.log([1e-3, 2e-3, 5e-4, 1e-3])
    error, x, v, slopes = dense_model(problem, state, logs)
    inverse = np.linalg.inv(v)
    projected = inverse - inverse @ x @ np.linalg.solve(x.T @ inverse @ x, x.T @ inverse)
    working = np.array([each @ projected @ error for each in slopes])
    dense = working @ projected @ working.T
    np.testing.assert_allclose(posterior(model, logs).average_information(), dense, rtol=1e-5, atol=1e-6 * dense.max())


@pytest.mark.parametrize("arms", ["both", "stations", "halves"])
def test_value_equals_the_dense_formula(arms):
    """Between sigmas it changes like the restricted likelihood of all residuals and stops."""
    problem, state = problem_at_truth(replace(NOISY, target="pose", arms=arms, camera_mount="fixed"))
    model = mixed_model(problem, state, ROBOTS)
    rows = np.log([[1e-3, 2e-3, 1e-3, 2e-3], [3e-3, 1e-3, 5e-4, 4e-3]])
    ours = [posterior(model, logs).value for logs in rows]
    dense = [dense_value(problem, state, logs) for logs in rows]
    assert ours[1] - ours[0] == pytest.approx(dense[1] - dense[0], abs=1e-3)
    assert abs(dense[1] - dense[0]) > 1


@pytest.mark.parametrize("arms", ["both", "halves", "stations"])
@pytest.mark.parametrize("smooth", [False, True])
def test_slope_equals_finite_differences(arms, smooth):
    """The slopes by sigmas of views, robots and smooth errors agree with central differences to 1e-3."""
    problem, state = problem_at_truth(replace(NOISY, arms=arms, intrinsics="free", state_pixel_noise=False))
    rng = np.random.default_rng(0)
    state = replace(state, stop_errors=1e-3 * rng.standard_normal(state.stop_errors.shape))
    modes = {robot: rng.standard_normal((count_stops(problem, robot), 2)) for robot in ROBOTS} if smooth else {}
    shared = {robot: SharedErrors.repeat_coordinates(of) for robot, of in modes.items()}
    model = mixed_model(problem, state, ROBOTS, [shared] if smooth else [])
    logs = np.log([0.3, *[1e-3, 2e-3] * (4 if smooth else 2)]) + 0.2 * rng.standard_normal(model.sigmas.count)
    steps = 1e-4 * np.eye(len(logs))
    differences = [(posterior(model, logs + h).value - posterior(model, logs - h).value) / 2e-4 for h in steps]
    np.testing.assert_allclose(posterior(model, logs).slope(), differences, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("constant", ["_CHUNK_NUMBERS", "_MOST_PADDING"])
def test_chunking_of_blocks_has_no_effect(monkeypatch, constant):
    """Value, slope, means and covariance are the same with single blocks per chunk, or without padding."""
    problem, state = two_arm_problem(1e-3 * np.random.default_rng(2).standard_normal((6, 6)), *STAR)
    model = mixed_model(problem, state, ROBOTS)
    logs = np.log([1e-3, 2e-3, 1e-3, 2e-3, 3e-3, 1e-3])
    together = posterior(model, logs)
    slope = together.slope()
    count = len(list(model.layout.chunks(len(model.prior))))
    monkeypatch.setattr(f"basecal.estimation.noise.layout.{constant}", 1)
    assert len(list(model.layout.chunks(len(model.prior)))) > count
    apart = posterior(model, logs)
    assert apart.value == pytest.approx(together.value, rel=1e-11)
    np.testing.assert_allclose(apart.slope(), slope, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(apart.mean_errors, together.mean_errors, rtol=1e-8, atol=1e-12)
    rounding = 1e-9 * np.abs(together.covariance).max()  # for entries that are differences of larger ones
    np.testing.assert_allclose(apart.covariance, together.covariance, rtol=1e-8, atol=rounding)


@pytest.mark.parametrize("arms", ["both", "halves", "stations"])
def test_columns_alone_equal_the_whole_solution(arms):
    """Without the errors in blocks the columns are the same to the last bit."""
    problem, state = problem_at_truth(replace(NOISY, arms=arms, state_pixel_noise=False))
    model, logs = mixed_model(problem, state, ROBOTS), np.log([0.3, 1e-3, 2e-3, 1e-3, 2e-3])
    whole, alone = posterior(model, logs), solve_columns(node_equations(model, logs[None]), np.arange(len(model.prior)))
    assert alone.value[0] == whole.value
    np.testing.assert_array_equal(alone.mean[0], whole.mean_columns)
    np.testing.assert_array_equal(alone.spread[0], whole.spread)


@pytest.mark.parametrize("at_once", [1, 1_000_000])
def test_batch_of_nodes_equals_single_nodes(monkeypatch, rng, at_once):
    """Nodes are the same for any chunk size, with one part or several, for some columns in any order."""
    monkeypatch.setattr("basecal.estimation.noise.reml._CHUNK_NUMBERS", at_once)
    model, _ = made_up(rng)
    nodes, columns = rng.standard_normal((7, 11)), np.array([4, 0, 3])
    together = solve_columns(node_equations(model, nodes), columns)
    for node, value, mean, spread in zip(nodes, together.value, together.mean, together.spread, strict=True):
        alone = posterior(model, node)
        assert value == pytest.approx(alone.value, rel=1e-12)
        np.testing.assert_allclose(mean, alone.mean_columns[columns], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(spread, alone.spread[np.ix_(columns, columns)], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("arms", ["both", "stations"])
def test_block_sums_equal_the_general_case(arms):
    """With a single part, the slope equals that of two equal halves, which use the general case."""
    problem, state = problem_at_truth(replace(NOISY, target="chessboard", arms=arms, state_pixel_noise=False))
    model = mixed_model(problem, state, ROBOTS)
    ((camera, name),) = model.parts
    half = {f.name: 0.5 * getattr(model.parts[camera, name], f.name) for f in fields(Moments)}
    stated = {(camera, name): Moments(**half), (camera, STATED): Moments(**half)}
    logs = np.log([1.0, 1e-3, 2e-3, 5e-4, 1e-3])  # at 1 px both halves have equal weights
    whole, cut = posterior(model, logs), posterior(replace(model, parts=stated), logs)
    np.testing.assert_allclose(whole.value - cut.value, 0, atol=1e-8 * abs(whole.value))
    np.testing.assert_allclose(cut.slope()[1:], whole.slope()[1:], rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(2 * cut.slope()[0], whole.slope()[0], rtol=1e-8)


@pytest.mark.parametrize("is_open", [True, False, None])
@pytest.mark.parametrize("exact", [(), ("eye", "hand")])
def test_time_stamp_jitter_is_noise_along_the_motion(is_open, exact):
    """Each view has its own jitter along its motion, equal to the dense formula.

    The sigma is open or known, and arms are noisy or exact. Moving views without time stamp jitter are like any others.
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
    assert list(model.sigmas.jitter) == (["wrist"] if is_open else [])
    sigmas = np.log([[1e-3, 2e-3, 5e-4, 1e-3, 2e-3], [3e-3, 1e-3, 5e-4, 4e-3, 1e-3 if is_open else 2e-3]])
    if is_open is None:
        motion = np.zeros_like(motion)
    keep = [*range(4 if robots else 0), *([4] if is_open else [])]
    values = [posterior(model, logs[keep]).value for logs in sigmas]
    dense = [
        dense_value_with_jitter(problem, state, logs[:4] if robots else None, motion * np.exp(logs[4]))
        for logs in sigmas
    ]
    assert values[1] - values[0] == pytest.approx(dense[1] - dense[0], abs=1e-3)
    assert abs(dense[1] - dense[0]) > 0.5 or not keep
    step, covariance = dense_solution_with_jitter(
        problem, state, sigmas[0][:4] if robots else None, motion * np.exp(sigmas[0][4])
    )
    found = posterior(model, sigmas[0][keep])
    np.testing.assert_allclose(found.step, step, atol=1e-6)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-3, atol=1e-10)


def dense_model_with_jitter(problem, state, logs, shake):
    """Residuals, derivative and covariance with jitter along (n, 6), and arms with sigmas or exact."""
    error, x, v, _ = dense_model(problem, state, np.zeros(4) if logs is None else logs)
    inner = right_jacobian_inverse(error.reshape(-1, 6))
    z = (inner @ shake[..., None])[..., 0]
    for k, each in enumerate(z):
        v[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] += np.outer(each, each)
    return error, x, v


def dense_value_with_jitter(problem, state, logs, shake):
    error, x, v = dense_model_with_jitter(problem, state, logs, shake)
    information = x.T @ np.linalg.solve(v, x)
    explained = (x.T @ np.linalg.solve(v, error)) @ np.linalg.solve(information, x.T @ np.linalg.solve(v, error))
    value = np.linalg.slogdet(v)[1] + np.linalg.slogdet(information)[1]
    return value + error @ np.linalg.solve(v, error) - explained


def dense_solution_with_jitter(problem, state, logs, shake):
    """The generalised least-squares step, and its covariance."""
    error, x, v = dense_model_with_jitter(problem, state, logs, shake)
    covariance = np.linalg.inv(x.T @ np.linalg.solve(v, x))
    return -covariance @ (x.T @ np.linalg.solve(v, error)), covariance


def test_jitter_of_still_views_is_not_open():
    """Views without motion have no information on it."""
    problem, state = problem_at_truth(replace(NOISY, target="pose", camera_mount="fixed"))
    problem = replace(problem, open_jitter=frozenset({"wrist"}))
    assert open_jitter(problem) == ()
    (group,) = problem.groups
    moving = replace(group, motion=np.ones((len(group), 6)))
    assert open_jitter(problem.with_groups([moving])) == ("wrist",)
    assert open_jitter(problem.with_groups([moving.take(np.zeros(0, dtype=int))])) == ()
    assert open_jitter(replace(problem.with_groups([moving]), open_jitter=frozenset())) == ()
    assert not mixed_model(problem, state, ROBOTS).sigmas.jitter


@pytest.fixture(params=[(*OPEN, ALL_STATED), OPEN[:1], (ALL_STATED,)], ids=["parts", "open", "stated"])
def synthetic_model(request, rng):
    """A synthetic model, its explicit parts, and sigmas; a single part uses sums over blocks."""
    model, parts = made_up(rng, request.param)
    return model, parts, np.exp(0.5 * rng.standard_normal(9 + len(model.sigmas.views)))


def test_posterior_equals_one_matrix_inverse(synthetic_model):
    """Value, means and covariances of columns and block errors equal one inverse of the whole system."""
    model, parts, sigmas = synthetic_model
    found, expected = posterior(model, np.log(sigmas)), expand_model(model, parts, sigmas)
    assert found.value == pytest.approx(expected.value, rel=1e-8)
    mean, covariance = expected.mean, expected.covariance
    np.testing.assert_allclose(found.mean_columns, mean[:COLUMNS], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.mean_errors.ravel(), mean[COLUMNS:], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.spread, covariance[:COLUMNS, :COLUMNS], rtol=1e-6, atol=1e-8)
    np.testing.assert_array_equal(found.step, found.mean_columns[:UNKNOWNS])
    np.testing.assert_array_equal(found.covariance, found.spread[:UNKNOWNS, :UNKNOWNS])
    own = np.linalg.inv(expected.information[COLUMNS:, COLUMNS:])
    for block in range(BLOCKS):
        here = slice(block * ROWS, (block + 1) * ROWS)
        np.testing.assert_allclose(found.blocks.own[block], own[here, here], rtol=1e-8, atol=1e-10)
    assert not found.blocks.lost.any()
    some = np.array([1, 4, 10])
    known = take(solve_columns(node_equations(model, np.log(sigmas)[None]), some), 0)
    np.testing.assert_allclose(known.mean, mean[some], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(known.spread, covariance[np.ix_(some, some)], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(scales(np.log(sigmas), model.of_columns), expected.scales[:COLUMNS])


def test_stop_errors_are_in_their_units(synthetic_model):
    """Errors from blocks and columns are multiplied by their sigmas, and so are shared errors."""
    model, parts, sigmas = synthetic_model
    expected = expand_model(model, parts, sigmas)
    units = expected.mean * expected.scales
    errors, (_, shared) = units[COLUMNS:].reshape(BLOCKS, ROWS), model.layout.shared[0]["hand"]
    of_stops = np.array([errors[0, :6], units[3:9], errors[1, :6]])
    of_stops[1:] += shared.by_stop @ units[9:11]
    np.testing.assert_allclose(posterior(model, np.log(sigmas)).stop_errors, of_stops, rtol=1e-6, atol=1e-8)


def test_slope_and_average_information_equal_explicit_formulas(synthetic_model):
    """The slope is that of the value.

    The information is 4 (S - V' M^-1 V), with V by the terms that each sigma scales.
    """
    model, parts, sigmas = synthetic_model
    found, logs, step = posterior(model, np.log(sigmas)), np.log(sigmas), 1e-5
    slope = [
        (expand_model(model, parts, np.exp(logs + h)).value - expand_model(model, parts, np.exp(logs - h)).value)
        / (2 * step)
        for h in step * np.eye(len(logs))
    ]
    np.testing.assert_allclose(found.slope(), slope, rtol=1e-5, atol=1e-5)
    general = replace(found, blocks=replace(found.blocks, lost=np.ones(BLOCKS)))
    np.testing.assert_allclose(general.slope(), found.slope(), rtol=1e-7, atol=1e-7)
    at, keys = expand_model(model, parts, sigmas), list(model.sigmas.views)
    mean = at.mean
    v, squares = np.zeros((len(sigmas), len(mean))), np.zeros(len(sigmas))
    for i, key in enumerate(keys):
        scaled = parts[key].both * at.scales
        left = parts[key].residual + scaled @ mean
        v[i], squares[i] = at.weights[key] * scaled.T @ left, at.weights[key] * left @ left
    which = np.concatenate([model.of_columns, model.of_errors.ravel()])
    for i in range(len(keys), len(sigmas)):
        v[i] = np.where(which == i, mean, 0.0)
        squares[i] = v[i] @ v[i]
    expected = 4 * (np.diag(squares) - v @ at.covariance @ v.T)
    np.testing.assert_allclose(found.average_information(), expected, rtol=1e-5, atol=1e-6)


def test_unscaled_errors_are_unchanged(synthetic_model):
    """Errors of a robot without an open sigma are unscaled, in blocks and columns."""
    model, parts, sigmas = synthetic_model
    of_errors, of_columns = model.of_errors.copy(), model.of_columns.copy()
    of_errors[0, :6] = -1
    of_columns[3:9] = -1
    model = replace(model, of_errors=of_errors, of_columns=of_columns)
    found, expected = posterior(model, np.log(sigmas)), expand_model(model, parts, sigmas)
    assert found.value == pytest.approx(expected.value, rel=1e-8)
    step = 1e-5 * np.eye(len(sigmas))
    slope = [
        (posterior(model, np.log(sigmas) + h).value - posterior(model, np.log(sigmas) - h).value) / 2e-5 for h in step
    ]
    np.testing.assert_allclose(found.slope(), slope, rtol=1e-5, atol=1e-5)


def test_rounded_away_identity_is_raised():
    """The identity is raised by 1e-13 of a much larger matrix, so that the result stays regular.

    1e12 still leaves four digits.
    """
    assert _rounding_loss(np.array([np.diag([0.9e12, 1.0])])) is None
    assert _rounding_loss(np.zeros((0, 2, 2))) is None
    np.testing.assert_allclose(_rounding_loss(np.array([np.diag([1.0, 2e12]), np.diag([0.9e12, 1.0])])), [0.2, 0.0])


def test_directions_without_information_have_a_floor():
    """The floor is 1e-11 of the former information, and negative values count as that."""

    def solve(hessian, information):
        """Inverse and log determinant."""
        equations = Equations(np.zeros(1), np.array([hessian]), np.array([information]), np.zeros((1, 2)))
        found = _solve(equations, np.arange(2))
        return found.spread[0], found.value[0]

    for last, held in ((0.0, 1e-11), (-1.0, 1e-11), (16 * 3e-11, 4e-11)):
        inverse, log_det = solve(np.diag([4.0, last]), [4.0, 16.0])
        np.testing.assert_allclose(inverse, np.diag([0.25, 1 / (16 * held)]), rtol=1e-6, atol=1e-6)
        assert log_det == pytest.approx(np.log(4.0) + np.log(16 * held))
    inverse, log_det = solve([[4.0, 3.0], [1.0, 9.0]], [4.0, 9.0])
    np.testing.assert_allclose(inverse, np.linalg.inv([[4.0, 2.0], [2.0, 9.0]]), rtol=1e-9)
    assert log_det == pytest.approx(np.log(32.0))


def test_rounding_does_not_break_the_sums(rng):
    """At a sigma a million times that of the residuals, mean and value are those of an unknown sigma."""
    model, parts = made_up(rng)
    sigmas = np.ones(11)
    sigmas[[2, 3, 6]] = 3e6  # shifts, turns and jitter of the first block
    found = posterior(model, np.log(sigmas))
    assert found.blocks.lost[0] > 0.0 == found.blocks.lost[1]
    expected = expand_model(model, parts, sigmas)
    np.testing.assert_allclose(found.mean_columns, expected.mean[:COLUMNS], rtol=1e-2, atol=1e-3)
    assert found.value == pytest.approx(expected.value, rel=1e-2)


def test_indistinguishable_unknowns_are_held(rng):
    """Unknowns that cannot be separated are held by 1e-11 of their own information, including the prior's."""
    model, parts = made_up(rng, OPEN)
    alike = {
        key: replace(of, column_jacobian=of.column_jacobian[:, [0, 1, 1, *range(3, COLUMNS)]])
        for key, of in parts.items()
    }
    prior, gradient = model.prior.copy(), np.zeros(COLUMNS)
    prior[:3, :3] = 0.0
    prior[1:3, 1:3] = 500.0
    moments = {key: of.moments() for key, of in alike.items()}
    model = replace(model, parts=moments, prior=prior, prior_gradient=gradient)
    sigmas = np.ones(11)
    diagonal = np.diag(prior) + sum(np.diag(of.fixed_fixed) for of in moments.values())
    held = replace(model, prior=prior + 1e-11 * np.diag(diagonal))
    assert posterior(model, np.log(sigmas)).value == pytest.approx(expand_model(held, alike, sigmas).value, abs=1e-2)
