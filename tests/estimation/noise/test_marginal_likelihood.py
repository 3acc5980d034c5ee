"""The marginal likelihood of sigmas, against the dense formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.jacobians import by_stop_errors, by_unknowns
from basecal.estimation.noise.estimate import NoiseEstimate, degrees_of_freedom
from basecal.estimation.noise.marginal_likelihood import (
    VarianceModel,
    log_sigma_covariance,
    marginal_likelihood,
    most_likely,
    neg2_log_likelihood,
    neg2_log_likelihood_slope,
)
from basecal.estimation.noise.robot_noise import with_robot_noise, without_errors
from basecal.estimation.noise.satterthwaite import freedoms_of
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State, chain
from basecal.estimation.solve import solve_from
from basecal.estimation.view.measurement import Noise
from basecal.geometry.se3 import right_jacobian_inverse
from basecal.simulation import Scenario, simulate

POOL = ("eye", "hand")
ROBOTS = VarianceModel((), (POOL,))


def posed(arms="halves", **more):
    """A problem of measured poses and its optimum without noise of robots."""
    s = simulate(
        Scenario(samples=8, target="pose", arms=arms, robot_noise=(1e-3, 2e-3), state_robot_noise=False, **more), seed=1
    )
    problem, _ = build_problem(s.cell, s.recording)
    start = State(s.truth, {}, np.zeros((0, 6)))
    return problem, bundle_adjust(problem, start, degrees_of_freedom(problem)).state


def dense_surprise(problem, state, pair):
    """log|V| + log|X'V^-1 X| + r'P r, with V of views and stops written out in full."""
    problem = with_robot_noise(problem, dict.fromkeys(POOL, np.repeat(pair, 3)))
    state = without_errors(problem, state)
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
    z = z.reshape(6 * n, -1)
    v = np.diag(group.measurement.weight.ravel() ** -2.0) + z @ z.T
    vx, vr = np.linalg.solve(v, x), np.linalg.solve(v, error.ravel())
    information = x.T @ vx
    explained = (x.T @ vr) @ np.linalg.solve(information, x.T @ vr)
    return np.linalg.slogdet(v)[1] + np.linalg.slogdet(information)[1] + error.ravel() @ vr - explained


@pytest.mark.parametrize("arms", ["both", "stations"])
def test_surprise_is_that_of_the_dense_formula(arms):
    """Between two pairs of sigmas it changes as the restricted likelihood of all residuals and stops written out."""
    problem, state = posed(arms, camera_mount="fixed")
    pairs = np.array([[1e-4, 2e-4], [5e-4, 1e-3]])
    evidence = marginal_likelihood(problem, state)
    ours = [neg2_log_likelihood(evidence, ROBOTS, np.log(pair)) for pair in pairs]
    dense = [dense_surprise(problem, state, pair) for pair in pairs]
    assert ours[1] - ours[0] == pytest.approx(dense[1] - dense[0], abs=0.02)
    assert abs(dense[1] - dense[0]) > 1


def test_slope_is_the_derivative():
    """The slope agrees with differences, of fields and of robots, to 1 % and 0.02."""
    problem, state = posed(state_observation_noise=False)
    evidence = marginal_likelihood(problem, state)
    model = VarianceModel(("pose_m", "pose_rad"), (POOL,))
    logs = np.log([8e-4, 4e-3, 7e-4, 1.5e-3])
    _, slope = neg2_log_likelihood_slope(evidence, model, logs)
    steps = 1e-3 * np.eye(4)
    differences = [
        (neg2_log_likelihood(evidence, model, logs + h) - neg2_log_likelihood(evidence, model, logs - h)) / 2e-3
        for h in steps
    ]
    np.testing.assert_allclose(slope, differences, rtol=0.01, atol=0.02)


def test_factor_alone_is_the_reduced_chi_square():
    """With all sigmas stated and one factor asked for, it is the cost over the degrees of freedom."""
    problem, state = posed()
    found = most_likely(marginal_likelihood(problem, state), VarianceModel(factored=True), np.zeros(1))
    cost = bundle_adjust(problem, state, 10).cost
    assert found.sigmas.factor == pytest.approx(cost / degrees_of_freedom(problem), rel=1e-3)


def test_spread_of_one_sigma_is_that_of_a_chi_square():
    """The logarithm of one unknown sigma has the variance 1 / (2 nu)."""
    s = simulate(Scenario(samples=10, target="led", camera_mount="fixed", state_pixel_noise=False), seed=3)
    problem, _ = build_problem(s.cell, s.recording)
    end = solve_from(problem, State(s.truth, s.cameras, np.zeros((0, 6))))
    evidence = marginal_likelihood(problem, end.state)
    found = most_likely(evidence, VarianceModel(("pixel_px",)), np.log([end.noise.noise.pixel_px]))
    assert found.sigmas.noise.pixel_px == pytest.approx(end.noise.noise.pixel_px, rel=1e-3)
    assert log_sigma_covariance(evidence, found)[0, 0] == pytest.approx(1 / (2 * end.dof), rel=0.05)


def test_freedoms_of_robots_alone_grow_with_the_stops():
    """A covariance that rests on robots' sigmas has more degrees of freedom the more stops there were."""
    found = []
    for samples in (10, 40):
        s = simulate(Scenario(samples=samples, robot_noise=(3e-4, 5e-4), state_robot_noise=False), seed=0)
        problem, _ = build_problem(s.cell, s.recording)
        noise = NoiseEstimate(Noise(), 1.0, (), True, dict.fromkeys(POOL, np.repeat([3e-4, 5e-4], 3)))
        problem = with_robot_noise(problem, noise.robots)
        state = without_errors(problem, State(s.truth, s.cameras, np.zeros((0, 6))))
        state = bundle_adjust(problem, state, degrees_of_freedom(problem)).state
        found.append(freedoms_of(problem, state, noise, "eye_base_from_hand_base"))
    # 10 samples of 6 residuals a view leave 42 for 18 unknowns, 40 leave 222; no direction rests on more than these.
    assert 5 < found[0] < 60
    assert 3 * found[0] < found[1] < 240


def test_freedoms_of_stated_sigmas_are_without_end():
    """Where nothing was estimated the covariance is that of a normal; with one factor it has those of the residuals."""
    problem, state = posed()
    stated = NoiseEstimate(Noise(), 1.0, (), True)
    assert freedoms_of(problem, state, stated, "eye_base_from_hand_base") == np.inf
    scaled = replace(stated, factor=3.0)
    assert freedoms_of(problem, state, scaled, "eye_base_from_hand_base") == degrees_of_freedom(problem)
