"""Tests of the pattern of poses around a target."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.cell import RobotState, Sample
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.planning import poses
from basecal.planning.feasible import is_feasible
from basecal.planning.sketch import sketch_cell
from planar_arm import planar
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms()
SKETCH, HOME = sketch_cell(WORLD.cell), home(WORLD)


def test_planned_poses_are_feasible_and_varied():
    """Each pose passes all checks, and numbers count up.

    Both arms rotate by more than half a radian between some poses.
    """
    plan = poses.plan(SKETCH, HOME, 12)
    assert [sample.sample for sample in plan] == list(range(12))
    assert all(is_feasible(SKETCH, sample) for sample in plan)
    for robot in ("eye", "hand"):
        flanges = [SKETCH.base_from_flange(robot, sample.robots[robot]) for sample in plan]
        turns = [np.linalg.norm((flanges[0].inverse() @ flange).rotvec) for flange in flanges]
        assert max(turns) > 0.5


def test_no_feasible_pose_is_an_error(monkeypatch):
    """A target that is not visible at home is visible at no pose nearby."""
    turned = {**HOME, "eye": RobotState(joints_rad=HOME["eye"].joints_rad + np.pi * np.eye(6)[4])}
    monkeypatch.setattr(poses, "_DRAW_ROUNDS", 2)
    with pytest.raises(InputError, match="only 0 of 1 poses"):
        poses.plan(SKETCH, turned, 1)


def test_ordering_shortens_the_path():
    """The ordered samples have a shorter path than the samples in random order."""
    drawn = [Sample(0, robots=sample.robots) for sample in poses.plan(SKETCH, HOME, 12, seed=3)]
    shuffled = [drawn[k] for k in np.random.default_rng(0).permutation(12)]

    def way(samples):
        joints = np.stack([np.concatenate([s.robots[r].joints_rad for r in ("eye", "hand")]) for s in samples])
        return np.abs(np.diff(joints, axis=0)).max(1).sum()

    assert way(poses.order_samples(SKETCH, HOME, shuffled)) < way(shuffled)


def states(**joints):
    return Sample(0, robots={name: RobotState(joints_rad=np.array(each)) for name, each in joints.items()})


def test_path_length_is_largest_joint_motion():
    """The length is the largest of all robots that both samples have.

    For poses it is the largest translation or rotation.
    """
    start, end = states(eye=[0, 0, 0], hand=[0, 0, 0]), states(eye=[0.1, -0.3, 0], hand=[0.2, 0, 0])
    assert poses._path_length(SKETCH, start, end) == pytest.approx(0.3)
    assert poses._path_length(SKETCH, states(hand=[0, 0, 0]), end) == pytest.approx(0.2)
    assert poses._path_length(SKETCH, Sample(0), end) == 0.0
    ends = SE3.identity(), SE3.exp(np.array([0.1, 0, 0, 0, 0, -0.4]))
    assert poses._path_length(SKETCH, *(Sample(0, robots={"eye": RobotState(end)}) for end in ends)) == pytest.approx(
        0.4
    )


def test_nearest_sample_with_clear_path_follows(monkeypatch):
    """If no path is clear, the nearest sample follows. Numbers begin at zero."""
    samples = [states(eye=[at, 0.0]) for at in (3.5, 1.0, 2.0)]

    def ordered():
        found = poses.order_samples(SKETCH, states(eye=[0.0, 0.0]).robots, samples)
        assert [each.sample for each in found] == [0, 1, 2]
        return [each.robots["eye"].joints_rad[0] for each in found]

    monkeypatch.setattr(poses, "is_path_clear", lambda sketch, start, end: True)
    assert ordered() == [1, 2, 3.5]
    blocked = {(0.0, 1.0), (2.0, 1.0), (2.0, 3.5)}

    def is_clear(sketch, *ends):
        return tuple(each.robots["eye"].joints_rad[0] for each in ends) not in blocked

    monkeypatch.setattr(poses, "is_path_clear", is_clear)
    assert ordered() == [2, 1, 3.5]


def test_samples_with_blocked_path_are_redrawn(monkeypatch):
    """The other samples are kept, and each round draws the same number with the same reach."""
    drawn, unclear = [], iter([[0, 2], []])

    def draw(sketch, views, count, reach, rng):
        drawn.append((count, dict(reach)))
        return [states(eye=[float(len(drawn)), float(k)]) for k in range(3)]

    monkeypatch.setattr(poses, "draw_feasible", draw)
    monkeypatch.setattr(poses, "is_path_clear", lambda *given: True)
    monkeypatch.setattr(poses, "blocked_samples", lambda sketch, home, plan: next(unclear))
    plan = poses.plan(SKETCH, states(eye=[0.0, 0.0]).robots, 3)
    assert [each.robots["eye"].joints_rad.tolist() for each in plan] == [[1, 1], [2, 0], [2, 1]]
    assert drawn == [(6, dict.fromkeys(("eye", "hand"), (0.6, 0.12)))] * 2


def test_path_length_with_joints_at_one_end():
    """If only one end has joints, the length is that of the flange poses. Robots of only one sample do not count."""
    chain = planar(0.5, 0.4)
    sketch = SimpleNamespace(
        base_from_flange=lambda robot, state: (
            state.base_from_flange if state.joints_rad is None else chain.forward(state.joints_rad)
        )
    )
    bent, straight = np.array([0.0, 0.3]), SE3(np.eye(3), np.array([0.9, 0.0, 0.0]))
    one = Sample(0, robots={"arm": RobotState(joints_rad=bent), "other": RobotState(straight)})
    for state, length in ((RobotState(straight), 0.3), (RobotState(joints_rad=np.array([0.2, -0.2])), 0.5)):
        other = Sample(1, robots={"arm": state})
        assert poses._path_length(sketch, one, other) == pytest.approx(length)
        assert poses._path_length(sketch, other, one) == pytest.approx(length)
    assert poses._path_length(sketch, Sample(0), one) == 0.0
