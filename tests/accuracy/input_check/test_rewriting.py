"""Rewriting a recording: each undoes what it is for, and touches nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.input_check import rewriting
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def poses(recording, robot):
    return [s.robots[robot].base_from_flange.matrix for s in recording.samples]


def test_inverting_one_robot_leaves_the_other():
    """The eye's poses are the inverses, the hand's as they were."""
    given = simulate(Scenario(samples=4), 0).recording
    told = rewriting.with_robots(given, {"eye": rewriting.inverted})
    np.testing.assert_allclose(np.linalg.inv(poses(told, "eye")), poses(given, "eye"), atol=1e-12)
    np.testing.assert_array_equal(poses(told, "hand"), poses(given, "hand"))


def test_without_links_offsets_are_estimated_still():
    """Of both kinds of parameters, and of their values, those of the joints are left."""
    made = simulate(Scenario(samples=4, joints=True, joint_offsets="free", link_parameters="free"), 0)
    values = {"joint_offsets": np.full(6, 0.1), "link_parameters": np.ones((7, 6))}
    robots = {name: Kinematics(robot.chain, values) for name, robot in made.cell.robots.items()}
    cell, state = rewriting.without_links(made.cell, State(made.truth, made.cameras, np.zeros((0, 6)), robots))
    assert [set(robot.parameters) for robot in cell.robots.values()] == [{"joint_offsets"}] * 2
    assert [set(of.values) for of in state.robots.values()] == [{"joint_offsets"}] * 2


def test_quaternion_orders_undo_one_another():
    """Scalar first read as last, and the reverse, give the rotation back, whatever the quaternion's sign."""
    turned = SE3.from_rotvec(np.random.default_rng(0).normal(size=(50, 3)), np.zeros((50, 3)))
    there = rewriting.reordered((1, 2, 3, 0))(turned)
    back = rewriting.reordered((3, 0, 1, 2))(there)
    np.testing.assert_allclose(back.rotation, turned.rotation, atol=1e-12)
    assert np.abs(there.rotation - turned.rotation).max() > 0.5


def test_through_the_camera_keeps_a_planes_lines_of_sight():
    """Points of a plane z = 0 lie on the same lines through the camera, on its other side."""
    camera_from_target = SE3.from_rotvec([[0.2, -0.3, 0.5]], [[0.1, 0.2, 0.9]])
    points = np.array([[0.1, 0.2, 0.0], [-0.3, 0.05, 0.0]])
    other = rewriting.through_the_camera(camera_from_target)
    assert np.linalg.det(other.rotation[0]) == pytest.approx(1.0)
    np.testing.assert_allclose(other[0] @ points, -(camera_from_target[0] @ points), atol=1e-12)


def test_shifting_there_and_back_loses_the_ends_only():
    """Observations moved one sample later and back stand where they stood; a sample goes at each move."""
    given = simulate(Scenario(samples=6), 0).recording
    there = rewriting.shifted(given, None, 1)
    assert [s.observations for s in there.samples] == [s.observations for s in given.samples[:-1]]
    back = rewriting.shifted(there, None, -1)
    assert [s.observations for s in back.samples] == [s.observations for s in given.samples[1:-1]]


def test_shifting_from_a_sample_on_keeps_those_before():
    """From position 3 on: 0 to 2 stay, 3 has nothing, 4 has what 3 had."""
    given = simulate(Scenario(samples=6), 0).recording
    told = rewriting.shifted(given, "hand", 1, start=3)
    assert [s.sample for s in told.samples] == [0, 1, 2, 4, 5]
    assert told.samples[2].robots["hand"] is given.samples[2].robots["hand"]
    assert told.samples[3].robots["hand"] is given.samples[3].robots["hand"]
    assert told.samples[3].robots["eye"] is given.samples[4].robots["eye"]
