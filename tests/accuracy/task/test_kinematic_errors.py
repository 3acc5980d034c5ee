"""Tests of flange derivatives by errors of joints and links, compared with arms that have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.task.kinematic_errors import (
    MODELS,
    error_jacobian,
    kinematic_errors,
    kinematics_jacobian,
    kinematics_of_robot,
    reach_points,
    to_base_axes,
)
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.robot_parameters import Kinematics, apply_step
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

STEP = 1e-6
JOINTS = Scenario(samples=6, joints=True)


def problem_and_state(scenario: Scenario):
    made = simulate(scenario, 2)
    problem, _ = build_problem(made.cell, made.recording)
    return made, problem, State(made.truth, made.cameras, np.zeros((0, 6)))


def make_wrong_arm(chain, error: int) -> Kinematics:
    """An arm with one error: offsets first, then links."""
    values = np.zeros(chain.n + 6 * (chain.n + 1))
    values[error] = STEP
    return Kinematics(chain, {"joint_offsets": values[: chain.n], "link_parameters": values[chain.n :].reshape(-1, 6)})


def test_errors_move_stops_and_points_as_arm():
    """Each column is the derivative by its error, of the flange at its stops and, in base axes, at points."""
    made, problem, state = problem_and_state(JOINTS)
    joints = np.array([sample.robots["hand"].joints_rad for sample in made.recording.samples])
    chain = problem.chains["hand"]
    found = kinematic_errors(problem, state, "hand")
    before = chain.forward(joints)
    at_points = error_jacobian(problem, state, "hand", before.translation)
    assert found.by_stop.shape == (6, 6, len(found.is_turn))
    for error in range(0, len(found.is_turn), 5):
        after = make_wrong_arm(chain, error).forward(joints)
        right = (before.inverse() @ after).log() / STEP
        np.testing.assert_allclose(right, found.by_stop[..., error], atol=1e-5)
        np.testing.assert_allclose((after.translation - before.translation) / STEP, at_points[:, :3, error], atol=1e-5)
        np.testing.assert_allclose((after @ before.inverse()).rotvec / STEP, at_points[:, 3:, error], atol=1e-5)


def test_rotational_errors_are_offsets_and_link_rotations():
    """Rotational errors are six offsets, then three of the six errors of each link."""
    _, problem, state = problem_and_state(JOINTS)
    found = kinematic_errors(problem, state, "eye")
    np.testing.assert_array_equal(found.is_turn, [True] * 6 + 7 * [False, False, False, True, True, True])


def test_models_are_parts_of_all_errors():
    """Offsets are the first six columns, links the others, at stops and at points."""
    made, problem, state = problem_and_state(JOINTS)
    places = made.true_base_from_flange["hand"].translation
    every, at_points = kinematic_errors(problem, state, "hand"), error_jacobian(problem, state, "hand", places)
    for kinds, part in zip(MODELS, (slice(0, 6), slice(6, 48), slice(0, 48)), strict=True):
        found = kinematic_errors(problem, state, "hand", kinds)
        np.testing.assert_array_equal(found.by_stop, every.by_stop[..., part])
        np.testing.assert_array_equal(found.is_turn, every.is_turn[part])
        moved = error_jacobian(problem, state, "hand", places, kinds)
        np.testing.assert_array_equal(moved, at_points[..., part])


@pytest.mark.parametrize(
    ("stated", "count"), [({}, 48), ({"joint_offsets": "prior"}, 42), ({"joint_offsets": "free"}, 48)]
)
def test_kinds_with_prior_are_excluded(stated, count):
    """Kinds with stated sigmas are estimated by these and excluded; a free kind is held by errors if unobservable."""
    _, problem, state = problem_and_state(replace(JOINTS, joint_offset_rad=1e-3, **stated))
    assert len(kinematic_errors(problem, state, "hand").is_turn) == count


def test_robots_with_poses_have_no_kinematic_errors():
    """A robot without a chain, or with priors on all kinds, has no kinematic errors."""
    _, problem, state = problem_and_state(Scenario(samples=6))
    assert kinematic_errors(problem, state, "hand") is None
    stated = {"joint_offsets": "prior", "link_parameters": "prior"}
    _, problem, state = problem_and_state(replace(JOINTS, joint_offset_rad=1e-3, link_error=(1e-4, 2e-4), **stated))
    assert kinematic_errors(problem, state, "hand") is None


@pytest.fixture(scope="module")
def arms():
    made = simulate(Scenario(samples=8, joints=True, joint_offset_rad=0.01, joint_offsets="prior"), 2)
    problem, _ = build_problem(made.cell, made.recording)
    return made, problem, State(made.truth, made.cameras, np.zeros((0, 6)), made.robots)


def test_jacobian_moves_flange_in_base(arms):
    """At recorded poses, each column moves the position and rotation of the flange in its base as the arm does."""
    made, problem, state = arms
    joints = np.array([sample.robots["hand"].joints_rad for sample in made.recording.samples])
    model = problem.models["hand"]
    before = state.kinematics(model)
    poses = before.forward(joints)
    found, columns = kinematics_jacobian(problem, state, "hand", poses.translation)
    (name,) = model.widths
    where = problem.columns[name]
    np.testing.assert_array_equal(columns, np.arange(where.start, where.stop))
    for column in range(len(columns)):
        after = apply_step(model, before, {name: STEP * np.eye(len(columns))[column]}).forward(joints)
        np.testing.assert_allclose((after.translation - poses.translation) / STEP, found[:, :3, column], atol=1e-5)
        turned = (after @ poses.inverse()).rotvec / STEP
        np.testing.assert_allclose(turned, found[:, 3:, column], atol=1e-5)


def test_unreachable_point_uses_nearest_pose(arms):
    """An unreachable point, ten metres away, uses the nearest pose of the arm, with finite values."""
    _, problem, state = arms
    found, _ = kinematics_jacobian(problem, state, "hand", np.array([[10.0, 0.0, 0.0]]))
    assert np.all(np.isfinite(found))


def test_robots_without_estimates_have_no_jacobian(arms):
    """A robot without estimated parameters, or recorded by poses, has no kinematics Jacobian."""
    made = simulate(Scenario(samples=4), 2)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    assert kinematics_jacobian(problem, state, "hand", np.zeros((1, 3))) is None


def test_arm_reaches_points_with_nearest_rotation(arms):
    """The arm reaches points a few millimetres from its poses within a tenth, with the nearest pose's rotation."""
    made, problem, state = arms
    recorded = np.array([sample.robots["eye"].joints_rad for sample in made.recording.samples])
    kinematics = kinematics_of_robot(problem, state, "eye")
    poses = kinematics.forward(recorded)
    order = np.array([5, 0, 3])
    points = poses.translation[order] + np.array([4e-3, -3e-3, 5e-3])
    sent = kinematics.forward(reach_points(problem, state, "eye", points)[1])
    np.testing.assert_allclose(sent.translation, points, atol=3e-4)
    np.testing.assert_allclose((poses[order].inverse() @ sent).rotvec, 0, atol=1e-3)


def test_derivatives_are_rotated_to_base_axes():
    """Translations and rotations of the flange are each rotated to base axes."""
    rng = np.random.default_rng(0)
    by_columns, rotation = rng.standard_normal((2, 6, 4)), SE3.exp(rng.standard_normal((2, 6))).rotation
    found = to_base_axes(by_columns, rotation)
    for k in range(2):
        np.testing.assert_allclose(found[k, :3], rotation[k] @ by_columns[k, :3])
        np.testing.assert_allclose(found[k, 3:], rotation[k] @ by_columns[k, 3:])
