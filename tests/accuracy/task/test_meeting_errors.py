"""Tests of the errors by which flanges miss one another, with robot errors that residuals do not show."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.systematic_errors.expected_sizes import with_expected_sizes
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.kinematic_errors import EXPECTED_PRIOR, kinematic_errors, reach_points
from basecal.accuracy.task.meeting import Meeting, MeetingJacobian, make_meeting
from basecal.accuracy.task.meeting_errors import (
    POSE_EFFECTS,
    _likely_models,
    _Model,
    _models_by_poses,
    _own_variance,
    field_covariance,
    meeting_errors,
    pose_error_jacobian,
    unseen_share,
)
from basecal.accuracy.task.task_error import error_map
from basecal.cell import Calibration, Recording, RobotState
from basecal.effects.faces.shared_errors import SharedTerm
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.joint_estimate import model_sigmas
from basecal.estimation.noise.random_effects import shared_errors
from basecal.estimation.noise.robot_noise import stop_poses
from basecal.estimation.problem.problem import Stops
from basecal.estimation.problem.robot_parameters import apply_step
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
UNSTATED = {"state_robot_noise": False, "state_pixel_noise": False, "robot_noise": (1e-4, 2e-4)}
ARMS = Scenario(samples=12, joints=True, **UNSTATED)
OFF = replace(ARMS, joint_offset_rad=2e-3)


def solve_scenario(scenario: Scenario):
    made = simulate(scenario, 3)
    return made, solve(made.cell, made.recording, Settings(robot_noise="estimated"))


def make_error_map(made, solution, **changed):
    robots = {name: {"sigma_t_m": of[:3], "sigma_r_rad": of[3:]} for name, of in solution.noise.robots.items()}
    calibration = Calibration("good", dict(solution.transforms), noise={"robots": robots})
    return error_map(
        calibration, ArmErrors(made.cell, solution, solution), made.truth[BASE].translation[None] / 2, **changed
    )


@pytest.fixture(scope="module")
def arms_off():
    return solve_scenario(OFF)


@pytest.fixture(scope="module")
def map_of_arms_off(arms_off):
    return make_error_map(*arms_off)


def test_joint_offsets_increase_angle_map(map_of_arms_off):
    """Joint offsets of 2 mrad, absorbed by mounts, give a map of at least 4 mrad elsewhere."""
    assert map_of_arms_off.angle_95_rad.min() > 4e-3


@pytest.mark.journey
def test_exact_arms_have_smaller_map(map_of_arms_off):
    """The same recording of exact arms has a map less than half as large."""
    assert make_error_map(*solve_scenario(ARMS)).angle_95_rad.max() < map_of_arms_off.angle_95_rad.min() / 2


@pytest.mark.journey
def test_widening_is_added_to_map(arms_off):
    """A widening of the base by 10 mrad about each axis is added to the rotations of the map."""
    made, solution = arms_off
    wider = np.zeros_like(solution.covariance)
    turns = np.arange(6)[3:] + solution.problem.columns[BASE].start
    wider[turns, turns] = 1e-4
    found = make_error_map(made, solution, widening=wider)
    assert found.angle_95_rad.min() > 2.7e-2
    assert found.angle_95_rad.max() < 4e-2


@pytest.mark.journey
def test_pose_robot_beside_joint_robot():
    """With a robot by poses beside one by joints, the map is between that of two joint robots and that of none."""
    made = simulate(OFF, 3)
    samples = [
        replace(
            sample,
            robots={**sample.robots, "eye": replace(sample.robots["eye"], joints_rad=None, base_from_flange=pose)},
        )
        for sample, pose in zip(made.recording.samples, made.true_base_from_flange["eye"], strict=True)
    ]
    recording = replace(made.recording, samples=tuple(samples))
    cell = replace(made.cell, robots={**made.cell.robots, "eye": replace(made.cell.robots["eye"], chain=None)})
    solution = solve(cell, recording, Settings(robot_noise="estimated"))
    robots = {name: {"sigma_t_m": of[:3], "sigma_r_rad": of[3:]} for name, of in solution.noise.robots.items()}
    calibration = Calibration("good", dict(solution.transforms), noise={"robots": robots})
    found = error_map(calibration, ArmErrors(cell, solution, solution), made.truth[BASE].translation[None] / 2)
    assert 1e-3 < found.angle_95_rad.min() < 2e-2


@pytest.mark.journey
@pytest.mark.parametrize("scenario", [ARMS, replace(ARMS, joints=False)], ids=["joints", "poses"])
def test_models_do_not_remove_effect(scenario: Scenario) -> None:
    """A base moved by 5 mm by an effect stays so: robot models do not include the effect."""
    made, fitted = solve_scenario(scenario)
    step = SE3(np.eye(3), np.array([5e-3, 0.0, 0.0]))
    moved = {**fitted.state.transforms, BASE: fitted.state.transforms[BASE] @ step}
    answer = replace(fitted, state=replace(fitted.state, transforms=moved))
    means = []
    for solution in (fitted, answer):
        meeting = make_meeting(
            made.cell, solution.problem, solution.state, BASE, made.truth[BASE].translation[None] / 2
        )
        means.append(meeting_errors(meeting, ArmErrors(made.cell, fitted, solution), {})[0])
    np.testing.assert_allclose(*means, atol=1e-4)


@pytest.mark.journey
def test_models_are_mixed_by_evidence(arms_off, monkeypatch):
    """Mean and covariance are those of the mixture of models by offsets, links and both, weighted by Bayes."""
    made, solution = arms_off
    problem, state = solution.problem, solution.state
    points = made.truth[BASE].translation[None] / 2
    meeting = make_meeting(made.cell, problem, state, BASE, points)
    mean, covariance = meeting_errors(meeting, ArmErrors(meeting.cell, solution, solution), {})
    likelihoods, means, covariances = [], [], []
    for kinds in (["joint_offsets"], ["link_parameters"], ["joint_offsets", "link_parameters"]):
        monkeypatch.setattr("basecal.accuracy.task.arm_errors.MODELS", (tuple(kinds),))
        arms = {robot: kinematic_errors(problem, state, robot, kinds) for robot in ("eye", "hand")}
        evidence = model_sigmas(problem, state, solution.noise, [SharedTerm(arms, EXPECTED_PRIOR)]).minus_2_log_evidence
        likelihoods.append(np.exp(-evidence / 2 - 500))
        alone = meeting_errors(meeting, ArmErrors(meeting.cell, solution, solution), {})
        means.append(alone[0][0])
        covariances.append(alone[1][0])
    shares = np.array(likelihoods) / sum(likelihoods)
    assert np.count_nonzero(shares > 0.02) > 1
    wanted = sum(share * each for share, each in zip(shares, means, strict=True))
    np.testing.assert_allclose(mean[0], wanted, rtol=1e-9)
    squares = sum(share * (each + np.outer(at, at)) for share, each, at in zip(shares, covariances, means, strict=True))
    np.testing.assert_allclose(covariance[0], squares - np.outer(wanted, wanted), rtol=1e-6, atol=1e-14)


@pytest.mark.journey
def test_estimated_kinematics_add_their_uncertainty():
    """Offsets with a prior of 2 mrad leave flanges uncertain by milliradians, which fixed ones do not."""
    found = {}
    for status, sigma in (("fixed", 0.0), ("prior", 2e-3)):
        made = simulate(Scenario(samples=8, joints=True, joint_offsets=status, joint_offset_rad=sigma), 3)
        solution = solve(made.cell, made.recording)
        calibration = Calibration("good", dict(solution.transforms))
        found[status] = error_map(
            calibration, ArmErrors(made.cell, solution, solution), made.truth[BASE].translation[None] / 2
        ).angle_95_rad
    assert np.all(found["prior"] > 2e-3)
    assert found["prior"].min() > 2 * found["fixed"].max()


def test_meeting_moves_with_base_and_both_arms():
    """The covariance is J C J', by differences of base and arms at recorded poses.

    Each robot's mean own variance is added.
    """
    made = simulate(
        Scenario(samples=6, joints=True, joint_offsets="prior", joint_offset_rad=2e-3, robot_noise=(1e-4, 2e-4)), 3
    )
    solution = solve(made.cell, made.recording)
    problem, state = solution.problem, solution.state
    noise = {"robots": {"hand": {"smooth": {"sigma": [3e-3, 0, 0, 0, 0, 6e-3]}}}}
    base, step = state.transforms[BASE], 1e-6
    recorded = np.array([s.robots["hand"].joints_rad for s in made.recording.samples])
    hand = state.kinematics(problem.models["hand"])
    at_hand = hand.forward(recorded).translation
    points = base @ at_hand
    eye_joints = reach_points(problem, state, "eye", points)[1]
    meeting = make_meeting(made.cell, problem, state, BASE, points)
    mean, found = meeting_errors(meeting, ArmErrors(meeting.cell, solution, solution), noise)
    np.testing.assert_array_equal(mean, 0)
    columns = np.zeros((len(points), 6, problem.width))
    for k in range(6):
        moved = SE3.exp(step * np.eye(6)[k])
        columns[:, :3, problem.columns[BASE].start + k] = (moved @ at_hand - at_hand) / step
        columns[:, 3:, problem.columns[BASE].start + k] = moved.rotvec / step
    for robot, joints in (("hand", recorded), ("eye", eye_joints)):
        model = problem.models[robot]
        (name,) = model.widths
        where, before = problem.columns[name], state.kinematics(model)
        poses = before.forward(joints)
        for k in range(where.stop - where.start):
            values = {name: step * np.eye(where.stop - where.start)[k]}
            after = apply_step(model, before, values).forward(joints)
            shift, turn = (after.translation - poses.translation) / step, (after @ poses.inverse()).rotvec / step
            if robot == "eye":  # negated, in the axes of the hand's base
                shift, turn = (-each @ base.rotation for each in (shift, turn))
            columns[:, :3, where.start + k], columns[:, 3:, where.start + k] = shift, turn
    places, turns = 2 * 1e-8 + 9e-6 / 3, 2 * 4e-8 + 36e-6 / 3
    by_columns, by_robots = columns @ solution.covariance @ columns.mT, np.diag(np.repeat([places, turns], 3))
    wanted = by_columns + by_robots
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-4 * np.abs(wanted).max())
    exact = replace(meeting, problem=replace(problem, stops=replace(problem.stops, sigma=0 * problem.stops.sigma)))
    _, without = meeting_errors(exact, ArmErrors(exact.cell, solution, solution), {})
    np.testing.assert_allclose(found - without, np.broadcast_to(by_robots, found.shape), atol=1e-15)
    assert meeting.mean_square_m2(solution.covariance) == pytest.approx(
        np.mean(np.trace(by_columns[:, :3, :3], axis1=1, axis2=2)) + 6e-8
    )


def test_own_variance_includes_stops_and_shared_errors():
    """A robot's own variance is the mean of its stops and shared errors over axes.

    Estimated variances replace stated sigmas.
    """
    smooth = {"smooth": {"sigma": [3.0, 0.0, 0.0, 0.0, 0.0, 6.0]}}
    noise = {"robots": {"plain": {}, "smooth": smooth, "estimated": smooth}}
    stops = Stops(np.tile([1.0, 2.0, 3.0, 1.0, 1.0, 4.0], (3, 1)), ("plain", "smooth", "estimated"))
    meeting = Meeting(SimpleNamespace(stops=stops), None, BASE, "plain", np.zeros((1, 3)), {}, None)
    solution = SimpleNamespace(noise=SimpleNamespace(robot_variances={"estimated": np.arange(6.0)}))
    found = {name: _own_variance(meeting, solution, noise, name) for name in (*noise["robots"], "exact")}
    np.testing.assert_allclose(found["plain"], [14 / 3, 6.0])
    np.testing.assert_allclose(found["smooth"], [14 / 3 + 3, 6.0 + 12])
    np.testing.assert_allclose(found["estimated"], [1.0 + 3, 4.0 + 12])
    np.testing.assert_array_equal(found["exact"], 0)


def model_of(minus_2_log_evidence, prior):
    """A model without shared errors."""
    return _Model(SimpleNamespace(minus_2_log_evidence=minus_2_log_evidence), [], [], prior)


def test_models_are_weighted_by_prior_and_evidence():
    """A model three times as likely by evidence and half as likely before has 0.6; unlikely ones are omitted."""
    models = [model_of(500.0, 1.0), model_of(500.0 + 2 * np.log(3), 2.0), model_of(520.0, 1.0), model_of(1.0, 0.0)]
    found = _likely_models(models)
    assert [model for _, model in found] == models[:2]
    np.testing.assert_allclose([share for share, _ in found], [0.6, 0.4], rtol=1e-4)


def test_time_errors_are_unknown_at_points(monkeypatch):
    """Errors in time have full variance at each point of an arm that has them.

    The other robot is in their model, too.
    """
    (by_times,) = (name for name, effect in RANDOM_EFFECTS.items() if effect.by_times is not None)
    layout = SimpleNamespace(shared=[{"hand": (3, 5), "third": (5, 7)}, {"eye": (7, 9)}])
    sigmas = SimpleNamespace(shared=[{"hand": slice(1, 2), "third": slice(2, 3)}, {"eye": slice(4, 5)}])
    plain, timed = (
        SimpleNamespace(minus_2_log_evidence=0.0, model=SimpleNamespace(layout=layout, sigmas=sigmas)) for _ in range(2)
    )
    places = {"eye": np.zeros((2, 3)), "hand": np.zeros((2, 3))}
    monkeypatch.setattr("basecal.accuracy.task.meeting_errors.open_robots", lambda problem: ["hand"])
    meeting = Meeting(None, None, BASE, "hand", np.zeros((2, 3)), places, None)
    arms = SimpleNamespace(fitted=SimpleNamespace(noise=SimpleNamespace(models={"": plain, by_times: timed})))
    first, second = _models_by_poses(meeting, arms)
    assert (first.sigmas, list(first.unknown), second.sigmas) == (plain, [], timed)
    ((place, share),) = second.unknown
    assert place == slice(1, 2)
    np.testing.assert_array_equal(share, [1.0, 1.0])
    assert (first.prior, second.prior) == (0.5, 0.5)
    monkeypatch.setattr("basecal.accuracy.task.meeting_errors.open_robots", lambda problem: ["third"])
    assert _models_by_poses(meeting, arms) == []


ARMS_POSE_ERRORS = Scenario(samples=20, robot_noise=(3e-5, 5e-5), state_robot_noise=False, state_pixel_noise=False)


def wrong_by_place(made, size):
    """The recording with poses of the hand shifted smoothly by some size [m]."""
    weights, samples = size * np.random.default_rng(0).standard_normal((3, 3)), []
    for sample in made.recording.samples:
        pose = sample.robots["hand"].base_from_flange
        shifted = SE3(pose.rotation, pose.translation + weights @ np.sin(4 * pose.translation))
        samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(shifted)}))
    return Recording(tuple(samples))


@pytest.fixture(scope="module")
def solved_of_pose_errors():
    made = simulate(ARMS_POSE_ERRORS, 1)
    return made, solve(made.cell, wrong_by_place(made, 1e-3), Settings(robot_noise="estimated"))


@pytest.mark.parametrize("name", POSE_EFFECTS)
def test_pose_errors_at_recorded_poses_equal_stops(solved_of_pose_errors, name):
    """At recorded poses, pose errors equal those of stops in base axes, but for omitted modes.

    Three metres away they are unknown.
    """
    problem = solved_of_pose_errors[1].problem
    poses, seen = stop_poses(problem, "hand")
    at_stops = shared_errors(RANDOM_EFFECTS[name], problem, "hand").by_stop[seen]
    places = poses[np.flatnonzero(seen)].translation
    found = pose_error_jacobian(problem, "hand", places, name)
    np.testing.assert_allclose(found, np.kron(np.eye(2), poses.rotation[seen]) @ at_stops, atol=1e-12)
    assert unseen_share(problem, "hand", places, name).max() < 0.08
    assert unseen_share(problem, "hand", places + np.array([0, 0, 3.0]), name).min() > 0.99


def test_error_absorbed_by_base_counts_once(solved_of_pose_errors):
    """At recorded places the miss is better known than from base and errors alone.

    95 in 100 are within three sigmas.
    """
    made, solution = solved_of_pose_errors
    poses = made.true_base_from_flange["hand"]
    places = solution.state.transforms[BASE] @ poses.translation
    meeting = make_meeting(made.cell, solution.problem, solution.state, BASE, places)
    widening = with_expected_sizes(made.cell, solution, None).covariance - solution.covariance
    mean, covariance = meeting_errors(meeting, ArmErrors(made.cell, solution, solution), {"robots": {}}, widening)
    alone = meeting.total_covariance(solution.covariance + widening, ())
    (name,) = solution.noise.common
    assert "hand" in solution.noise.common[name]
    assert np.trace(covariance.mean(0)[:3, :3]) < 0.7 * np.trace(alone.mean(0)[:3, :3])
    meant = np.array([s.robots["hand"].base_from_flange.translation for s in wrong_by_place(made, 1e-3).samples])
    missed = solution.state.transforms[BASE].inverse() @ (made.truth[BASE] @ poses.translation) - meant
    off = missed - mean[:, :3]
    distance = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance[:, :3, :3]), off)
    assert np.all(np.linalg.eigvalsh(covariance)[:, 0] > 0)
    assert np.mean(distance < 9) > 0.9


MADE = simulate(Scenario(samples=12, robot_noise=(2e-4, 5e-4), position_m=0.03, spread_rad=0.3), 4)
SOLUTION = solve(MADE.cell, MADE.recording, Settings(robot_noise="stated"))
PLACES = SOLUTION.problem.robot_ends("hand")[0].base_from_flange.translation


def added_covariance(points_m, is_total=False, has_base=True):
    """Covariance that the hand's field adds at its flange, with or without the base, which absorbs the shared part."""
    robots = {name: replace(robot, is_total_noise=is_total) for name, robot in MADE.cell.robots.items()}
    name, cell = MADE.cell.requested_transforms[0], replace(MADE.cell, robots=robots)
    in_world = SOLUTION.state.transforms[name] @ points_m
    meeting = make_meeting(cell, SOLUTION.problem, SOLUTION.state, name, in_world)
    meeting = replace(meeting, places_m={"hand": points_m})
    if not has_base:
        vars(meeting)["moves"] = MeetingJacobian(np.zeros((len(points_m), 6, 0)), np.zeros(0, dtype=np.int64))
    return field_covariance(meeting, ArmErrors(meeting.cell, SOLUTION, SOLUTION))


def test_field_is_full_far_from_samples():
    """Two metres away the field has full variance, and an axis length error grows with the distance."""
    far = added_covariance(PLACES + np.array([0.0, 0.0, 2.0]), has_base=False)
    np.testing.assert_allclose(far, far.mT, atol=1e-18)
    assert (np.linalg.eigvalsh(far) > -1e-18).all()
    assert far[:, 0, 0].min() > 1e-4**2
    assert (far[:, 2, 2] > 2 * far[:, 0, 0]).all()


def test_total_noise_has_no_field():
    """Robots whose noise is total are as accurate as stated and have no field."""
    assert not added_covariance(PLACES, is_total=True).any()


@pytest.mark.journey
def test_field_absorbed_by_base_counts_once():
    """Samples share most of a field, which moves the base instead, so beside the base it adds less."""
    shared, alone = (np.trace(added_covariance(PLACES, has_base=each).mean(0)[:3, :3]) for each in (True, False))
    assert shared < 0.95 * alone
