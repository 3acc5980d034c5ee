"""Tests of the joint estimate of unstated noise, and of wide covariances if data do not determine it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import with_eye
from tests.made_up_model import OPEN, made_up
from tests.pose_problem import pose_problem

from basecal.estimation.noise import joint_estimate
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.noise.joint_estimate import _units, estimate_jointly, integrate_sigmas
from basecal.estimation.noise.laplace import SigmaPosterior
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import STATED, Settings
from basecal.estimation.solve import Solution, solve_from
from basecal.estimation.view.measurement import Noise
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from quick import quick

ESTIMATED = Settings(robot_noise="estimated")
TRUE = (3e-4, 5e-4)
SILENT = Scenario(samples=20, robot_noise=TRUE, state_robot_noise=False)
BASE = "eye_base_from_hand_base"


def solve_scenario(scenario: Scenario, seed: int, settings: Settings = ESTIMATED) -> Solution:
    """The optimum reached from the truth."""
    s = simulate(scenario, seed)
    problem, _ = build_problem(s.cell, s.recording)
    return solve_from(
        problem, State(s.truth, s.cameras if problem.lenses else {}, np.zeros((len(problem.stops), 6))), settings
    )


def base_nees(scenario: Scenario, seeds: range) -> list[float]:
    """Squared Mahalanobis distance of the base from the truth over its six freedoms, by seed."""
    found = []
    for seed in seeds:
        truth, estimate = simulate(scenario, seed).truth[BASE], solve_scenario(scenario, seed).transforms[BASE]
        off = (truth.inverse() @ estimate.mean).log()
        found.append(float(off @ np.linalg.solve(estimate.covariance, off)) / 6)
    return found


@pytest.mark.journey
@pytest.mark.parametrize("is_stated", quick([True, False], [False]))
def test_robot_sigmas_are_estimated(is_stated):
    """The mean over four cells is the truth, with the pixels' sigma stated or estimated.

    One cell scatters by 18 %, a mean of four by 9 %: five are 45 %; priors take their share of that.
    """
    cells = [solve_scenario(replace(SILENT, state_pixel_noise=is_stated), seed) for seed in range(4)]
    found = np.mean([cell.noise.robots[robot][[0, 3]] for cell in cells for robot in ("eye", "hand")], axis=0)
    np.testing.assert_allclose(found, TRUE, rtol=0.45)
    if not is_stated:
        assert np.mean([cell.noise.noise.pixel_px for cell in cells]) == pytest.approx(0.2, rel=0.15)


@pytest.mark.journey
def test_different_robots_have_their_own_sigmas():
    """The rotations of an arm ten times as noisy as the other are separated by their levers."""
    s = simulate(replace(SILENT, samples=40, robot_noise=(1e-4, 2e-4)), seed=0)
    rng = np.random.default_rng(1)
    samples = []
    for sample in s.recording.samples:
        hand = sample.robots["hand"]
        off = SE3.exp(rng.standard_normal(6) * np.repeat([1e-3, 2e-3], 3))
        moved = replace(hand, base_from_flange=hand.base_from_flange @ off)
        samples.append(replace(sample, robots={**sample.robots, "hand": moved}))
    problem, _ = build_problem(s.cell, replace(s.recording, samples=tuple(samples)))
    found = solve_from(problem, State(s.truth, s.cameras, np.zeros((0, 6))), ESTIMATED).noise.robots
    assert found["hand"][3] == pytest.approx(2e-3, rel=0.35)
    assert found["eye"][3] < 0.4 * found["hand"][3]


@pytest.mark.journey
def test_clean_cells_have_little_robot_noise():
    """Without robot noise, the estimate is below that of good arms: 0.05 mm and 0.05 mrad."""
    found = [
        solve_scenario(Scenario(samples=12, state_pixel_noise=False), seed).noise.robots["hand"] for seed in range(2)
    ]
    assert np.max(found) < 5e-5


def test_stated_noise_is_not_estimated():
    """If every robot and the pixels state their noise, requesting an estimate has no effect."""
    stated = replace(SILENT, state_robot_noise=True)
    asked, plain = solve_scenario(stated, 0), solve_scenario(stated, 0, STATED)
    assert not asked.noise.robots
    np.testing.assert_allclose(asked.covariance, plain.covariance, rtol=1e-6)


def test_still_arm_has_the_noise_of_the_other():
    """A single stop shows no noise of its own. The other arm determines it, and the base's sigmas contain it."""
    found = solve_scenario(replace(SILENT, arms="eye_still", camera_mount="fixed"), 0)
    still, moving = found.noise.robots["eye"], found.noise.robots["hand"]
    assert 0.3 < still[3] / moving[3] < 3
    assert found.transforms[BASE].sigma_t.min() > 0.5 * still[0]


@pytest.mark.journey
@pytest.mark.parametrize("samples", quick([4, 10], [4]))
def test_covariance_of_few_samples_covers_the_truth(samples):
    """With four boards or more and no stated noise, at most two of 6 bases are outside of their 95 % ellipsoid.

    With a chance of a twentieth each, three and more are one case in five hundred.
    """
    silent = replace(SILENT, samples=samples, robot_noise=(1e-4, 2e-4), state_pixel_noise=False)
    assert np.sum(6 * np.array(base_nees(silent, range(6))) > 12.59) <= 2


@pytest.mark.slow
def test_led_views_widen_the_covariance():
    """A view has two equations and neither sigma is stated: the bases of 8 cells agree with their covariances."""
    light = Scenario(samples=25, target="led", robot_noise=(2e-4, 3e-4), state_robot_noise=False)
    assert 0.3 < np.mean(base_nees(replace(light, state_pixel_noise=False), range(8))) < 1.9


def test_exact_data_have_no_noise():
    """Data without noise give sigmas far below those of any camera or arm."""
    found = solve_scenario(Scenario(samples=8, pixel_px=0.0, state_pixel_noise=False), 0)
    assert found.converged
    assert found.noise.noise.pixel_px < 1e-2
    assert found.noise.robots["hand"].max() < 1e-5


@pytest.mark.journey
def test_smooth_errors_widen_the_covariance():
    """An arm with errors that are smooth in its pose is distinguished from one without."""
    still = Scenario(samples=40, arms="eye_still", camera_mount="fixed", state_robot_noise=False)
    s = simulate(still, 3)
    bent = []
    for sample in s.recording.samples:
        hand = sample.robots["hand"]
        wave = np.sin(hand.base_from_flange.rotvec / 0.3 + np.array([0.0, 1.0, 2.0]))
        moved = hand.base_from_flange @ SE3.exp(np.concatenate([1e-3 * wave, 2e-3 * wave[::-1]]))
        bent.append(replace(sample, robots={**sample.robots, "hand": replace(hand, base_from_flange=moved)}))
    start = State(s.truth, s.cameras, np.zeros((0, 6)))
    problem, _ = build_problem(s.cell, replace(s.recording, samples=tuple(bent)))
    used, end, noise = estimate_jointly(build_problem(s.cell, s.recording)[0], start, 100)
    none = integrate_sigmas(used, end.state, noise)
    used, end, noise = estimate_jointly(problem, start, 100)
    found = integrate_sigmas(used, end.state, noise)
    for robot, sigma in found.robots.items():  # of a log-normal the mean square is above the square of the mode
        assert np.all(found.robot_variances[robot] > sigma**2)
    assert not none.common
    assert found.common["smooth"]["hand"][1] > 3e-4


@pytest.mark.journey
def test_kinematic_errors_are_identified_and_widen_the_covariance():
    """Arms with wrong joint offsets, or links, show which. The covariance of the base then contains their effect."""
    plain = Scenario(samples=25, joints=True, state_robot_noise=False, robot_noise=(3e-5, 5e-5))
    for kind, scenario in {
        "joint_offsets": replace(plain, joint_offset_rad=2e-3),
        "link_parameters": replace(plain, link_error=(1e-3, 1e-3)),
    }.items():
        s = simulate(scenario, 1)
        used, end, noise = estimate_jointly(
            build_problem(s.cell, s.recording)[0], State(s.truth, s.cameras, np.zeros((0, 6))), 100
        )
        found = integrate_sigmas(used, end.state, noise)
        assert found.common.keys() == {kind}
        name = "eye_base_from_hand_base"
        base = used.columns[name]
        error = (end.state.transforms[name].inverse() @ s.truth[name]).log()
        assert error @ np.linalg.solve(found.covariance[base, base], error) < 20
        assert error @ np.linalg.solve(np.linalg.inv(end.normal.hessian)[base, base], error) > 20


def test_stated_robot_errors_are_in_metres():
    """Errors of a robot with an open sigma are in units of it."""
    s = simulate(Scenario(samples=4, robot_noise=TRUE), 0)
    problem, _ = build_problem(s.cell, s.recording)
    units = _units(problem, ["hand"])
    of_hand = np.array(problem.stops.robot) == "hand"
    assert sorted(set(of_hand)) == [False, True]
    np.testing.assert_allclose(units[of_hand], np.tile(np.repeat(TRUE, 3), (of_hand.sum(), 1)))
    np.testing.assert_array_equal(units[~of_hand], 1.0)


@pytest.mark.parametrize("settled", [True, False])
def test_many_views_start_from_a_converged_subset(monkeypatch, settled):
    """If the estimate of the subset does not converge, all views are used from the beginning."""
    s = simulate(replace(SILENT, samples=12), 0)
    problem, _ = build_problem(s.cell, s.recording)
    state = State(s.truth, s.cameras, np.zeros((len(problem.stops), 6)))
    monkeypatch.setattr(joint_estimate, "MANY_VIEWS", 8)
    if not settled:
        monkeypatch.setattr(joint_estimate, "_MOST_ALTERNATIONS", 0)
    asked, of_all = [], joint_estimate._extend_estimate
    monkeypatch.setattr(
        joint_estimate, "_extend_estimate", lambda *given: asked.append(len(given[0].groups[0])) or of_all(*given)
    )
    _, _, noise = estimate_jointly(problem, state, 50)
    assert asked == ([12] if settled else [])
    assert noise.converged == settled


@pytest.mark.parametrize(
    ("names", "priors"),
    [
        ([""], [1]),
        (["", "smooth"], [0.5, 0.5]),
        (["", "smooth", "smooth_by_place"], [0.5, 0.25, 0.25]),
        (["smooth", "deflection"], [0.5, 0.5]),
        (["", "deflection", "link_parameters"], [0, 0.5, 0.5]),
    ],
)
def test_shared_errors_have_a_prior_of_one_half(names, priors):
    """Models with and without shared errors are equally likely.

    If links or joint offsets are modelled, no arm is assumed exact, and the model without shared errors does not count.
    """
    np.testing.assert_allclose(joint_estimate.model_priors(names), priors)


def test_covariances_are_weighted_by_model_priors(monkeypatch):
    """Weights are in the order of the models, and the report has the model with the largest evidence."""
    models = {
        name: SimpleNamespace(minus_2_log_evidence=10.0 * len(name), name=name, logs=np.zeros(1))
        for name in ("", "deflection", "link_parameters")
    }
    counted = []
    monkeypatch.setattr(joint_estimate, "_sigma_models", lambda *of: models)
    monkeypatch.setattr(
        joint_estimate, "integrated_covariance", lambda of, prior, *how: counted.extend(prior) or np.eye(2)
    )
    noise = NoiseEstimate(Noise(), 1.0, (), True, logs=np.zeros(1))
    found = joint_estimate.integrate_sigmas(SimpleNamespace(width=2), None, noise)
    np.testing.assert_allclose(counted, [0, 0.5, 0.5])
    assert (found.minus_2_log_evidence, dict(found.common)) == (0.0, {})


def synthetic_posterior(rng, shapes=None):
    """Sigmas of two cameras and two robots, one jitter and one robot's shared errors, of a synthetic model."""
    model, _ = made_up(rng, OPEN)
    if shapes is not None:
        model = replace(model, layout=replace(model.layout, shapes=shapes))
    logs = np.log([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0])
    return SigmaPosterior(model, None, logs, np.diag(0.01 * np.arange(11.0)), 12.5)


def test_sigmas_are_assigned_by_name(rng):
    """The order of the logarithms is: fields of cameras, shift and rotation of each robot, jitter, shared errors."""
    of = synthetic_posterior(rng)
    found, (common,) = joint_estimate._estimate(of, SimpleNamespace(shapes={})), joint_estimate._shared_sigmas(of)
    assert found.cameras == {"left": Noise(pose_m=pytest.approx(1.0)), "right": Noise(pixel_px=pytest.approx(2.0))}
    assert found.robots.keys() == {"eye", "hand"}
    np.testing.assert_allclose(found.robots["eye"], [3.0] * 3 + [4.0] * 3)
    np.testing.assert_allclose(found.robots["hand"], [5.0] * 3 + [6.0] * 3)
    assert found.jitter_s == {"left": pytest.approx(7.0)}
    assert common.keys() == {"hand"}
    np.testing.assert_allclose(common["hand"], [10.0, 11.0])
    assert found.shapes == {}


def test_shapes_are_added_to_the_problems_shapes(rng):
    """The mean shape about the state and its covariance are added. The remaining change decides on convergence."""
    of = synthetic_posterior(rng, {"board": slice(3, 5)})
    mean, spread = of.columns.mean[3:5], of.columns.spread[3:5, 3:5]
    before = np.array([0.5, -1.0])
    for shapes, expected in (({}, mean), ({"board": before}, before + mean)):
        problem = SimpleNamespace(shapes=shapes)
        found = joint_estimate._estimate(of, problem).shapes["board"]
        np.testing.assert_allclose(found[0], expected)
        np.testing.assert_array_equal(found[1], spread)
        estimate = joint_estimate._final_estimate(of, problem, True)
        np.testing.assert_allclose(estimate.shapes["board"][0], before if shapes else mean)
    largest = np.abs(mean).max()
    for limit in (1.01 * largest, 0.99 * largest):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(joint_estimate, "_SETTLED_CHANGE", limit)
            assert joint_estimate._has_converged(of, of.logs) == (limit > largest)
    without = synthetic_posterior(rng)
    for step, expected in ((0.0, True), (0.019, True), (0.021, False)):
        off = without.logs + step * np.eye(len(without.logs))[0]
        assert joint_estimate._has_converged(without, off) == expected


def test_final_estimate_has_sigmas_and_mean_squares(rng):
    """Sigmas are by name. Robots also have the mean of squares, which for log-normals grows by twice the variance."""
    of = synthetic_posterior(rng)
    found = joint_estimate._final_estimate(of, SimpleNamespace(shapes={}), False)
    assert (found.factor, found.converged, found.minus_2_log_evidence, found.plain_minus_2_log_evidence) == (
        1.0,
        False,
        12.5,
        12.5,
    )
    assert found.estimated == ("pixel_px", "pose_m")
    assert found.noise == found.cameras["left"]
    assert found.jitter_s == {"left": pytest.approx(7.0)}
    np.testing.assert_array_equal(found.logs, of.logs)
    for robot, sigmas, variances in (("eye", (3, 4), (0.02, 0.03)), ("hand", (5, 6), (0.04, 0.05))):
        squares = [s**2 * np.exp(2 * v) for s, v in zip(sigmas, variances, strict=True)]
        np.testing.assert_allclose(found.robot_variances[robot], np.repeat(squares, 3))


def test_open_sigmas_are_unstated_ones():
    """Open sigmas are those of views, of robots with views, or jitter of moving cameras."""
    stated, _ = pose_problem(np.zeros((3, 6)), np.ones(6))
    silent, _ = pose_problem(np.zeros((3, 6)), None)
    assert not joint_estimate._is_open(stated)
    assert joint_estimate._is_open(silent)
    assert joint_estimate._is_open(replace(stated, unstated=frozenset({"eye"})))
    assert not joint_estimate._is_open(replace(stated, unstated=frozenset({"another"})))
    assert joint_estimate.open_robots(replace(stated, unstated=frozenset({"hand", "eye"}))) == ["eye"]
    moving = stated.with_groups([replace(stated.groups[0], motion=np.ones((3, 6)))])
    assert not joint_estimate._is_open(moving)
    assert joint_estimate._is_open(replace(moving, open_jitter=frozenset({"camera"})))


def test_reach_is_computed_from_observed_poses():
    """The reach is the root mean square distance of flange and base."""
    problem, _ = pose_problem(np.zeros((3, 6)), None)
    poses = SE3.from_rotvec(np.zeros((3, 3)), [[3.0, 0, 4.0], [0, 1.0, 0], [0, 0, 2.0]])
    moved = with_eye(problem.groups[0], base_from_flange=poses, stop_number=np.array([4, 0, 2]))
    assert joint_estimate._reach(problem.with_groups([moved]), "eye") == pytest.approx(np.sqrt(30.0 / 3))


def test_errors_are_rescaled_between_units():
    """Errors at stops of an open robot are in units of its sigma. At unit sigmas they are in metres and radians."""
    problem, state = pose_problem(np.zeros((2, 6)), None, stop_sigma=np.repeat([1e-3, 2e-3], 3))
    state = replace(state, stop_errors=np.ones((2, 6)))
    unit, physical = joint_estimate._unit_problem(problem, state, ["eye"])
    np.testing.assert_array_equal(unit.stops.sigma, 1.0)
    np.testing.assert_allclose(physical.stop_errors, np.tile(np.repeat([1e-3, 2e-3], 3), (2, 1)))
    same, as_it_was = joint_estimate._unit_problem(problem, state, [])
    np.testing.assert_array_equal(same.stops.sigma, problem.stops.sigma)
    np.testing.assert_array_equal(as_it_was.stop_errors, 1.0)
