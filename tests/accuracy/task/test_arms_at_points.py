"""How flanges at points move with their arms' kinematics, against differences."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.task.arms_at_points import moved_by_kinematics
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.robot_parameters import after_step
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
        after = after_step(model, before, {name: STEP * np.eye(len(columns))[column]}).forward(joints)
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
