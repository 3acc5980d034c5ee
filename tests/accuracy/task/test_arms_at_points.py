"""How flanges at points move with their arms' kinematics, against differences."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ends import end, problem_of, views

from basecal.accuracy.task.arms_at_points import (
    kinematics_of_robot,
    moved_by_kinematics,
    reach_points,
    recorded_joints,
    to_base_axes,
)
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.robot_parameters import apply_step
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

STEP = 1e-6


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
    found, columns = moved_by_kinematics(problem, state, "hand", poses.translation)
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
    found, _ = moved_by_kinematics(problem, state, "hand", np.array([[10.0, 0.0, 0.0]]))
    assert np.all(np.isfinite(found))


def test_nothing_of_arms_as_stated(arms):
    """A robot of which nothing is estimated, or recorded by poses, moves with nothing."""
    made = simulate(Scenario(samples=4), 2)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    assert moved_by_kinematics(problem, state, "hand", np.zeros((1, 3))) is None


def test_an_arm_is_sent_to_points_turned_as_in_the_nearest_pose(arms):
    """Its kinematics as estimated bring the flange to within a tenth of the millimetres from the recorded poses."""
    made, problem, state = arms
    recorded = recorded_joints(problem, "eye")
    np.testing.assert_array_equal(recorded, [sample.robots["eye"].joints_rad for sample in made.recording.samples])
    kinematics = kinematics_of_robot(problem, state, "eye")
    poses = kinematics.forward(recorded)
    order = np.array([5, 0, 3])
    points = poses.translation[order] + np.array([4e-3, -3e-3, 5e-3])
    sent = kinematics.forward(reach_points(problem, state, "eye", recorded, points))
    np.testing.assert_allclose(sent.translation, points, atol=3e-4)
    np.testing.assert_allclose((poses[order].inverse() @ sent).rotvec, 0, atol=1e-3)


def test_joints_of_all_views_in_which_a_robot_has_a_part():
    """On either side; none where it was recorded by poses."""
    q = np.arange(18.0).reshape(3, 6)
    problem = problem_of(
        views(end("a", joints=q), end("b")),
        views(end("b"), end("a", joints=q + 1)),
        views(end("c", joints=q + 2), end()),
    )
    np.testing.assert_array_equal(recorded_joints(problem, "a"), np.concatenate([q, q + 1]))
    np.testing.assert_array_equal(recorded_joints(problem, "c"), q + 2)
    assert recorded_joints(problem, "b") is None


def test_derivatives_in_the_axes_of_the_base():
    """Shifts and turns of the flange, each by its rotation."""
    rng = np.random.default_rng(0)
    by_columns, rotation = rng.standard_normal((2, 6, 4)), SE3.exp(rng.standard_normal((2, 6))).rotation
    found = to_base_axes(by_columns, rotation)
    for k in range(2):
        np.testing.assert_allclose(found[k, :3], rotation[k] @ by_columns[k, :3])
        np.testing.assert_allclose(found[k, 3:], rotation[k] @ by_columns[k, 3:])
