"""From a recording to arrays: joints stand for poses, stops are told apart, what is lacking is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.cell import PixelObservation, PointObservation, Recording, Robot, RobotState, Sample
from basecal.estimation.problem.build import build_problem, canonical_order
from basecal.estimation.problem.problem import Problem
from basecal.geometry import SE3
from basecal.kinematics import read_chain
from basecal.simulation import Scenario, simulate

URDF = Path(__file__).parents[2] / "data" / "urdf" / "six_axis.urdf"


def test_joints_stand_for_the_poses_they_give():
    """A hand recorded by joints is the hand recorded by the forward kinematics of these joints."""
    chain = read_chain(URDF, "base_link", "tool0")
    s = simulate(Scenario(samples=6), seed=0)
    joints = np.random.default_rng(0).uniform(-1, 1, (6, chain.n))
    poses = chain.forward(joints)
    by_joints, by_poses = (
        Recording(tuple(_with_hand(x, state(k)) for k, x in enumerate(s.recording.samples)))
        for state in (lambda k: RobotState(joints_rad=joints[k]), lambda k: RobotState(poses[k]))
    )
    cell = replace(s.cell, robots={**s.cell.robots, "hand": Robot("hand", chain=chain)})
    (first,), (second,) = (build_problem(cell, recording)[0].groups for recording in (by_joints, by_poses))
    np.testing.assert_allclose(
        first.hand_base_from_hand_flange.matrix, second.hand_base_from_hand_flange.matrix, atol=1e-12
    )


def _with_hand(sample: Sample, state: RobotState) -> Sample:
    return replace(sample, robots={**sample.robots, "hand": state})


def _at_poses(order: list[int], jitter_m: float = 0.0) -> Problem:
    """Three places of the eye, taken in an order and read back with jitter; a new view at each, the hand still."""
    s = simulate(Scenario(samples=len(order), robot_noise=(5e-5, 5e-5), target="led", arms="hand_still"), seed=0)
    rng = np.random.default_rng(0)
    samples = []
    for sample, place in zip(s.recording.samples, order, strict=True):
        pose = s.recording.samples[place].robots["eye"].base_from_flange
        assert pose is not None
        read = SE3(pose.rotation, pose.translation + jitter_m * rng.uniform(-1, 1, 3))
        samples.append(replace(sample, robots={**sample.robots, "eye": RobotState(read)}))
    return build_problem(s.cell, Recording(tuple(samples)))[0]


@pytest.mark.parametrize(("jitter_m", "stops"), [(0.0, [0, 0, 1, 1, 0, 2]), (5e-5, [0, 0, 1, 1, 2, 3])])
def test_a_stop_is_a_place(jitter_m, stops):
    """Poses that agree within what reading back makes of them are one stop in a row, equal ones wherever they are."""
    (group,) = _at_poses([0, 0, 1, 1, 0, 2], jitter_m).groups
    assert (group.eye_stop - group.eye_stop[0]).tolist() == stops
    assert len(set(group.hand_stop.tolist())) == 1
    assert set(group.eye_stop.tolist()).isdisjoint(group.hand_stop.tolist())


def test_copied_rows_count_once():
    """A view that says the same as an earlier one in the same place is left out and named; other noise is not."""
    s = simulate(Scenario(samples=6), seed=0)
    first, second = s.recording.samples[:2]
    again = replace(second, sample=7, robots=first.robots)
    copies = (*s.recording.samples, replace(first, sample=6), again)
    problem, findings = build_problem(s.cell, Recording(copies))
    assert sorted(problem.groups[0].sample.tolist()) == [0, 1, 2, 3, 4, 5, 7]
    assert [(f.code, f.about) for f in findings] == [("duplicate-samples", ("6",))]


def test_a_view_without_a_robots_pose_is_left_out_and_said():
    """The sample is named, and the others are used."""
    s = simulate(Scenario(samples=5), seed=0)
    without = replace(s.recording.samples[2], robots={"eye": s.recording.samples[2].robots["eye"]})
    samples = (*s.recording.samples[:2], without, *s.recording.samples[3:])
    problem, (finding,) = build_problem(s.cell, Recording(samples))
    assert problem.groups[0].sample.tolist() == [0, 1, 3, 4]
    assert finding.code == "dropped-sample"
    assert finding.about == ("2",)
    assert "no pose of hand" in finding.message


def test_samples_go_by_time_and_of_two_with_a_number_the_first_stays():
    """Stamps order samples where all have one, else numbers do."""
    timed = tuple(Sample(k, stamp_s=t) for k, t in ((0, 3.0), (1, 1.0), (2, 2.0)))
    assert [x.sample for x in canonical_order(timed)] == [1, 2, 0]
    assert [x.sample for x in canonical_order((Sample(2), Sample(1, stamp_s=9.0), Sample(0)))] == [0, 1, 2]
    first, second = Sample(4, stamp_s=None), Sample(4, images={"a": "b"})
    assert canonical_order((first, second)) == (first,)


def test_one_camera_may_see_pixels_and_points_of_one_target():
    """Kinds of measurement of the same pair are separate groups on the same unknowns."""
    s = simulate(Scenario(samples=4), seed=0)
    seen = s.recording.samples[0].observations[0]
    assert isinstance(seen, PixelObservation)
    in_camera = PointObservation(seen.camera, seen.target, seen.ids[:4], np.ones((4, 3)))
    mixed = replace(s.recording.samples[0], observations=(in_camera,))
    problem, _ = build_problem(s.cell, Recording((mixed, *s.recording.samples[1:])))
    assert [len(g) for g in problem.groups] == [3, 1]
    assert {g.camera_mount for g in problem.groups} == {"eye_flange_from_wrist"}
