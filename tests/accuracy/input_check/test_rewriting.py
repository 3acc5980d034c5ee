"""Rewriting a recording: each undoes what it is for, and touches nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.input_check import rewriting
from basecal.cell import PixelObservation, PointObservation, PoseObservation, Recording, RobotState, Sample
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


def test_angles_are_turned_into_degrees():
    """The rotation vector, or each of roll, pitch and yaw, is 57.3 times as large; places stay."""
    rng = np.random.default_rng(0)
    vectors, angles, places = 0.02 * rng.normal(size=(5, 3)), 0.01 * rng.normal(size=(5, 3)), rng.normal(size=(5, 3))
    found = rewriting.degrees(SE3.from_rotvec(vectors, places))
    np.testing.assert_allclose(found.rotvec, np.degrees(vectors), atol=1e-9)
    np.testing.assert_array_equal(found.translation, places)
    found = rewriting.degrees_of_rpy(SE3.from_rpy(angles, places))
    np.testing.assert_allclose(found.rpy, np.degrees(angles), atol=1e-9)
    np.testing.assert_array_equal(found.translation, places)
    np.testing.assert_array_equal(rewriting.scaled(3.0)(found).translation, 3 * places)
    np.testing.assert_array_equal(rewriting.scaled(3.0)(found).rotation, found.rotation)


def test_joints_of_one_robot_are_multiplied():
    """Where it has some; poses and the other robot stay."""
    given = simulate(Scenario(samples=3, joints=True), 0).recording
    pose = RobotState(SE3.identity())
    first = replace(given.samples[0], robots={**given.samples[0].robots, "eye": pose})
    given = replace(given, samples=(first, *given.samples[1:]))
    told = rewriting.with_joints(given, "eye", 0.5)
    assert told.samples[0].robots["eye"] is pose
    for before, after in zip(given.samples[1:], told.samples[1:], strict=True):
        np.testing.assert_array_equal(after.robots["eye"].joints_rad, 0.5 * before.robots["eye"].joints_rad)
        assert after.robots["hand"] is before.robots["hand"]
    swapped = rewriting.exchanged(given, "eye", "hand")
    for before, after in zip(given.samples, swapped.samples, strict=True):
        assert after.robots["eye"] is before.robots["hand"]
        assert after.robots["hand"] is before.robots["eye"]
        assert after.observations == before.observations


def test_what_is_seen_is_mapped_by_its_kind():
    """Poses, points in space and pixels each by their own; others stay as they are, in their order."""
    pixels = PixelObservation("a", "t", np.arange(2), np.array([[1.0, 2.0], [3.0, 4.0]]))
    points = PointObservation("b", "t", np.arange(1), np.array([[1.0, 2.0, 3.0]]))
    pose = PoseObservation("c", "t", SE3.from_rotvec([0, 0, 0.1], [1.0, 0, 0]))
    given = Recording((Sample(0, observations=(pixels, points, pose)), Sample(1, observations=(pose,))))
    first, second = rewriting.with_points(given, -2.0).samples
    np.testing.assert_array_equal(first.observations[1].points_in_camera, [[-2, -4, -6]])
    assert (first.observations[0], first.observations[2], second.observations) == (pixels, pose, (pose,))
    first, second = rewriting.with_pixels(given, lambda uv: uv[:, ::-1]).samples
    np.testing.assert_array_equal(first.observations[0].pixels, [[2, 1], [4, 3]])
    assert (first.observations[1:], second.observations) == ((points, pose), (pose,))
    first, second = rewriting.with_targets(given, rewriting.inverted).samples
    for seen in (first.observations[2], second.observations[0]):
        np.testing.assert_allclose(seen.camera_from_target.matrix, np.linalg.inv(pose.camera_from_target.matrix))
    assert first.observations[:2] == (pixels, points)


@pytest.mark.parametrize(
    ("by", "start", "pairs"),
    [
        (2, 0, [(2, 0), (3, 1), (4, 2), (5, 3)]),
        (-2, 0, [(0, 2), (1, 3), (2, 4), (3, 5)]),
        (-1, 3, [(0, 0), (1, 1), (2, 2), (3, 4), (4, 5)]),
        (1, 3, [(0, 0), (1, 1), (2, 2), (4, 3), (5, 4)]),
    ],
)
@pytest.mark.parametrize("stream", [None, "hand"])
def test_a_stream_is_paired_anew(by, start, pairs, stream):
    """Each sample with what stood so many earlier or later; all else of it stays."""
    given = simulate(Scenario(samples=6), 0).recording
    told = rewriting.shifted(given, stream, by, start)
    assert [s.sample for s in told.samples] == [to for to, _ in pairs]
    for sample, (to, of) in zip(told.samples, pairs, strict=True):
        seen, hand = (of, to) if stream is None else (to, of)
        assert sample.observations is given.samples[seen].observations
        assert sample.robots["hand"] is given.samples[hand].robots["hand"]
        assert sample.robots["eye"] is given.samples[to].robots["eye"]


def test_a_stream_is_turned_round():
    """The last first; samples that are left without the robot go."""
    given = simulate(Scenario(samples=4), 0).recording
    less = replace(given.samples[1], robots={"eye": given.samples[1].robots["eye"]})
    given = replace(given, samples=(given.samples[0], less, *given.samples[2:]))
    told = rewriting.turned_round(given, "hand")
    assert [s.sample for s in told.samples] == [0, 1, 3]
    for sample, of in zip(told.samples, (3, 2, 0), strict=True):
        assert sample.robots["hand"] is given.samples[of].robots["hand"]
    seen = rewriting.turned_round(given, None)
    assert [s.observations for s in seen.samples] == [s.observations for s in given.samples[::-1]]
