"""Poses all around a target."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import RobotState, Sample
from basecal.errors import InputError
from basecal.planning import poses
from basecal.planning.feasible import is_feasible
from basecal.planning.sketch import sketch_cell
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms()
SKETCH, HOME = sketch_cell(WORLD.cell), home(WORLD)


def test_every_pose_is_feasible_and_they_differ():
    """Each passes what it was asked to, both arms turn by more than half a radian between some, numbers count up."""
    plan = poses.plan(SKETCH, HOME, 12)
    assert [sample.sample for sample in plan] == list(range(12))
    assert all(is_feasible(SKETCH, sample) for sample in plan)
    for robot in ("eye", "hand"):
        flanges = [SKETCH.base_from_flange(robot, sample.robots[robot]) for sample in plan]
        turns = [np.linalg.norm((flanges[0].inverse() @ flange).rotvec) for flange in flanges]
        assert max(turns) > 0.5


def test_where_nothing_is_feasible_an_error_says_what_to_do(monkeypatch):
    """A target that its camera does not see at home is seen at no pose nearby."""
    turned = {**HOME, "eye": RobotState(joints_rad=HOME["eye"].joints_rad + np.pi * np.eye(6)[4])}
    monkeypatch.setattr(poses, "_DRAW_ROUNDS", 2)
    with pytest.raises(InputError, match="only 0 of 1 poses"):
        poses.plan(SKETCH, turned, 1)


def test_the_way_is_short():
    """Put in order, the way from one to the next is no longer than as drawn."""
    drawn = [Sample(0, robots=sample.robots) for sample in poses.plan(SKETCH, HOME, 12, seed=3)]
    shuffled = [drawn[k] for k in np.random.default_rng(0).permutation(12)]

    def way(samples):
        joints = np.stack([np.concatenate([s.robots[r].joints_rad for r in ("eye", "hand")]) for s in samples])
        return np.abs(np.diff(joints, axis=0)).max(1).sum()

    assert way(poses.order_samples(SKETCH, HOME, shuffled)) < way(shuffled)
