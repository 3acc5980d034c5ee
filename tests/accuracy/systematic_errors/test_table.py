"""The rows of the table move views as the errors they stand for do."""

from dataclasses import replace

import numpy as np
import pytest
from tests.accuracy.systematic_errors.test_search import on_a_path

from basecal.accuracy.systematic_errors.situation import Situation
from basecal.accuracy.systematic_errors.table import (
    TABLE,
    clock_drifts,
    clock_offsets,
    drifts,
    focal_lengths,
    joint_offsets,
    length_scales,
    sag,
    steps,
    yielding_joints,
)
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.estimation.solve import solve_packed
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


@pytest.fixture(scope="module")
def of():
    made = simulate(Scenario(samples=12), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = solve_packed(problem, made.cell).state
    return Situation(problem, state, problem, {k: float(k) for k in range(12)})


def moved_by_pose(of, robot, pose):
    """Tangents of the view where a robot's recorded poses are others, (n, 6)."""
    change = (of.recorded_pose(0, robot).inverse() @ pose).log()
    return (of.by_flange(0, robot) @ change[..., None])[..., 0]


def row(of, make, about):
    (found,) = [c for c in make(of) if c.about == (about,)]
    return found.moves[0][:, 0]


@pytest.mark.parametrize("robot", ["eye", "hand"])
def test_longer_poses(of, robot):
    """One unit of a robot's length scale makes its poses twice as long, to first order."""
    pose = of.recorded_pose(0, robot)
    longer = SE3(pose.rotation, (1 + 1e-6) * pose.translation)
    np.testing.assert_allclose(
        1e-6 * row(of, length_scales, robot)[..., 0], moved_by_pose(of, robot, longer), atol=1e-11
    )


def test_a_larger_target_is_seen_nearer(of):
    """One millionth that a target is larger than stated takes one of its distance from the camera; nothing turns."""
    at = of.state.camera_from_target(of.problem.groups[0], of.problem.stops)
    nearer = SE3(at.rotation, (1 - 1e-6) * at.translation)
    np.testing.assert_allclose(
        1e-6 * row(of, length_scales, "board")[..., 0], (at.inverse() @ nearer).log(), atol=1e-12
    )


@pytest.fixture(scope="module")
def of_light():
    made = simulate(Scenario(samples=8, target="led"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    return Situation(problem, solve_packed(problem, made.cell).state, problem, {k: float(k) for k in range(8)})


def test_through_a_longer_lens_a_light_is_seen_nearer(of_light):
    """Its image is where that of the same light is through the lens as stated, nearer by the same fraction."""
    group, longer = of_light.problem.groups[0], 1e-5
    lens = of_light.state.cameras[group.camera]
    at = of_light.state.camera_from_target(group, of_light.problem.stops)
    moves = longer * row(of_light, focal_lengths, group.camera)[..., 0]
    longer_lens = lens.with_parameters(lens.parameters * np.where(np.arange(len(lens.parameters)) < 2, 1 + longer, 1.0))
    nearer, as_stated = lens.project((at @ SE3.exp(moves)).translation), lens.project(at.translation)
    through_longer = longer_lens.project(at.translation)
    assert np.abs(through_longer - as_stated).max() > 1e-3
    np.testing.assert_allclose(nearer, through_longer, atol=1e-7)


def test_a_light_has_no_size(of_light):
    assert {about for c in length_scales(of_light) for about in c.about} == {"eye", "hand"}


def test_focal_lengths_are_looked_for_where_nothing_else_shows_them(of, of_light):
    """Not through targets with a size, nor of lenses that are estimated."""
    free = {name: replace(lens, status="free") for name, lens in of_light.problem.lenses.items()}
    assert list(focal_lengths(of)) == []
    assert list(focal_lengths(replace(of_light, problem=replace(of_light.problem, lenses=free)))) == []


def test_joint_offsets():
    """One unit of a joint's offset moves the view as the flange of an arm whose joint stands elsewhere."""
    made = simulate(Scenario(samples=6, joints=True), 0)
    problem, _ = build_problem(made.cell, made.recording)
    of = Situation(problem, solve_packed(problem, made.cell).state, problem, {k: float(k) for k in range(6)})
    every = list(joint_offsets(of))
    assert [(candidates.code, candidates.about[0]) for candidates in every] == [
        (code, robot) for robot in ("eye", "hand") for code in ("joint-offset", "joint-offsets")
    ]
    found = {candidates.about[0]: candidates for candidates in every[::2]}
    for alone, together in zip(every[::2], every[1::2], strict=True):
        np.testing.assert_array_equal(together.moves[0][:, 0], np.moveaxis(alone.moves[0][..., 0], 1, 2))
    assert found.keys() == {"eye", "hand"}
    (group,) = problem.groups
    for robot, joints in (("eye", group.eye_joints), ("hand", group.hand_joints)):
        assert found[robot].joint == tuple(range(6))
        for joint in range(6):
            moved = problem.chains[robot].forward(joints + 1e-6 * np.eye(6)[joint])
            expected = moved_by_pose(of, robot, moved)
            np.testing.assert_allclose(1e-6 * found[robot].moves[0][:, joint, :, 0], expected, atol=1e-11)


def test_offsets_that_are_estimated_or_have_no_joints_are_not_tested(of):
    """Neither robots given by poses nor those whose offsets are unknowns already."""
    assert list(joint_offsets(of)) == []
    made = simulate(Scenario(samples=12, joints=True, joint_offset_rad=1e-3, joint_offsets="prior"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = solve_packed(problem, made.cell).state
    assert list(joint_offsets(Situation(problem, state, problem, {}))) == []


def test_joints_yield_to_their_torques():
    """A unit of each compliance moves the view as a joint that turns by its torque; one for all is their sum."""
    made = simulate(Scenario(samples=6, joints=True), 0)
    problem, _ = build_problem(made.cell, made.recording)
    of = Situation(problem, solve_packed(problem, made.cell).state, problem, {k: float(k) for k in range(6)})
    alike, each = (c.moves[0][:, 0] for c in yielding_joints(of) if c.about == ("hand",))
    kinematics = Kinematics(problem.chains["hand"], {"deflection": 1e-8 * np.arange(1.0, 7.0)})
    moved = kinematics.forward(problem.groups[0].hand_joints)
    np.testing.assert_allclose(1e-8 * each @ np.arange(1.0, 7.0), moved_by_pose(of, "hand", moved), atol=1e-10)
    np.testing.assert_allclose(alike[..., 0], each.sum(-1))


def test_compliances_that_are_estimated_or_of_no_masses_are_not_tested(of):
    """Nor those of robots given by poses."""
    assert list(yielding_joints(of)) == []
    made = simulate(Scenario(samples=12, joints=True, compliance=1e-5, deflection="prior"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = solve_packed(problem, made.cell).state
    assert list(yielding_joints(Situation(problem, state, problem, {}))) == []
    light = {name: replace(chain, masses=None) for name, chain in problem.chains.items()}
    light_arms = replace(problem, chains=light, models={})
    assert list(yielding_joints(Situation(light_arms, state, light_arms, {}))) == []


def test_sag_turns_about_the_base(of):
    """One unit down turns the arm about its base by reach x down, along the base's axis or anywhere."""
    pose = of.recorded_pose(0, "hand")
    down = np.array([0.3, -0.2, -1.0])
    turn = np.concatenate([np.zeros((12, 3)), 1e-6 * np.cross(pose.translation, down)], -1)
    along, anywhere = (c.moves[0][:, 0] for c in sag(of) if c.about == ("hand",))
    np.testing.assert_allclose(1e-6 * anywhere @ down, moved_by_pose(of, "hand", SE3.exp(turn) @ pose), atol=1e-10)
    np.testing.assert_array_equal(along, anywhere[..., 2:])


def test_steps_and_drifts_in_time(of):
    """A step moves nothing before its sample and all after; a drift the last sample as a step does, the first not."""
    for name in of.frames:
        frame = of.by_frame(0, name)
        candidates = next(c for c in steps(of) if c.about[0] == name)
        for b, since in enumerate(candidates.since):
            np.testing.assert_allclose(candidates.moves[0][:since, b], 0)
            np.testing.assert_allclose(candidates.moves[0][since:, b], frame[since:])
        np.testing.assert_allclose(row(of, drifts, name)[[0, -1]], frame[[0, -1]] * np.array([0, 1])[:, None, None])


def test_every_row_has_moves_for_all_views(of):
    """Of each kind (n, b, 6, q), as many as are named."""
    for make in TABLE:
        for kind in make(of):
            assert kind.moves[0].shape[:3] == (12, len(kind.about), 6)
            assert len(kind.since) == len(kind.about)


def test_a_clock_that_drifts_is_right_in_the_middle():
    """Half of a clock's offset at the last sample, and less than none at the first; of stamps that say when."""
    cell, recording = on_a_path(0.0)
    problem, _ = build_problem(cell, recording)
    of = Situation(
        problem, solve_packed(problem, cell).state, problem, {s.sample: s.stamp_s for s in recording.samples}
    )
    (offset,), (drift,) = clock_offsets(of), clock_drifts(of)
    share = np.linspace(-0.5, 0.5, 50)[of.rank(problem.groups[0])]
    np.testing.assert_allclose(drift.moves[0], share[:, None, None, None] * offset.moves[0], atol=1e-12)
    assert not list(clock_drifts(Situation(problem, of.state, problem, {})))
