"""How flanges move with errors of their arms' joints and links, against arms that have them."""

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


def shifted(chain, error: int) -> Kinematics:
    """An arm of one error: offsets first, then links."""
    values = np.zeros(chain.n + 6 * (chain.n + 1))
    values[error] = STEP
    return Kinematics(chain, {"joint_offsets": values[: chain.n], "link_parameters": values[chain.n :].reshape(-1, 6)})


def test_errors_move_stops_and_points_as_they_move_the_arm():
    """Each column is the derivative to its error, of the flange at its stops and, in base axes, sent there."""
    made, problem, state = problem_and_state(JOINTS)
    joints = np.array([sample.robots["hand"].joints_rad for sample in made.recording.samples])
    chain = problem.chains["hand"]
    found = kinematic_errors(problem, state, "hand")
    before = chain.forward(joints)
    at_points = error_jacobian(problem, state, "hand", before.translation)
    assert found.by_stop.shape == (6, 6, len(found.is_turn))
    for error in range(0, len(found.is_turn), 5):
        after = shifted(chain, error).forward(joints)
        right = (before.inverse() @ after).log() / STEP
        np.testing.assert_allclose(right, found.by_stop[..., error], atol=1e-5)
        np.testing.assert_allclose((after.translation - before.translation) / STEP, at_points[:, :3, error], atol=1e-5)
        np.testing.assert_allclose((after @ before.inverse()).rotvec / STEP, at_points[:, 3:, error], atol=1e-5)


def test_turns_are_offsets_and_turns_of_links():
    """Six offsets, then of each link three shifts and three turns."""
    _, problem, state = problem_and_state(JOINTS)
    found = kinematic_errors(problem, state, "eye")
    np.testing.assert_array_equal(found.is_turn, [True] * 6 + 7 * [False, False, False, True, True, True])


def test_models_are_parts_of_all_errors():
    """Offsets alone are the first six columns, links alone the others, at stops and at points."""
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
def test_what_has_a_prior_is_not_open(stated, count):
    """Kinds whose sigmas are stated are estimated by these; a free kind is held by errors where nothing shows it."""
    _, problem, state = problem_and_state(replace(JOINTS, joint_offset_rad=1e-3, **stated))
    assert len(kinematic_errors(problem, state, "hand").is_turn) == count


def test_robots_by_poses_have_none():
    """Without a chain, or with all kinds under priors."""
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


def test_derivative_is_of_the_flange_in_its_base(arms):
    """At the recorded poses of an arm, where its joints are known, each column moves place and turn as told."""
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


def test_points_out_of_reach_have_the_nearest(arms):
    """A point ten metres away is given the arm where it comes nearest; numbers stay finite."""
    _, problem, state = arms
    found, _ = kinematics_jacobian(problem, state, "hand", np.array([[10.0, 0.0, 0.0]]))
    assert np.all(np.isfinite(found))


def test_nothing_of_arms_as_stated(arms):
    """A robot of which nothing is estimated, or recorded by poses, moves with nothing."""
    made = simulate(Scenario(samples=4), 2)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    assert kinematics_jacobian(problem, state, "hand", np.zeros((1, 3))) is None


def test_an_arm_is_sent_to_points_turned_as_in_the_nearest_pose(arms):
    """Its kinematics as estimated bring the flange to within a tenth of the millimetres from the recorded poses."""
    made, problem, state = arms
    recorded = np.array([sample.robots["eye"].joints_rad for sample in made.recording.samples])
    kinematics = kinematics_of_robot(problem, state, "eye")
    poses = kinematics.forward(recorded)
    order = np.array([5, 0, 3])
    points = poses.translation[order] + np.array([4e-3, -3e-3, 5e-3])
    sent = kinematics.forward(reach_points(problem, state, "eye", points)[1])
    np.testing.assert_allclose(sent.translation, points, atol=3e-4)
    np.testing.assert_allclose((poses[order].inverse() @ sent).rotvec, 0, atol=1e-3)


def test_derivatives_in_the_axes_of_the_base():
    """Shifts and turns of the flange, each by its rotation."""
    rng = np.random.default_rng(0)
    by_columns, rotation = rng.standard_normal((2, 6, 4)), SE3.exp(rng.standard_normal((2, 6))).rotation
    found = to_base_axes(by_columns, rotation)
    for k in range(2):
        np.testing.assert_allclose(found[k, :3], rotation[k] @ by_columns[k, :3])
        np.testing.assert_allclose(found[k, 3:], rotation[k] @ by_columns[k, 3:])
