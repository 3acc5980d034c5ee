"""Joints as JSON."""

from __future__ import annotations

import json

import numpy as np

from basecal.exchange.motions.joints import write_motion
from shared.motion_ways import joints_of, of_joints


def test_every_digit_is_there() -> None:
    """What is read back is the plan, in the chain's order."""
    way = of_joints()
    found = json.loads(write_motion(way))
    assert found["samples"] == [20, 21, 22]
    for robot, of in found["robots"].items():
        assert tuple(of["joint_names"]) == way.joint_names(robot)
        assert np.array_equal(of["joints_rad"], joints_of(way, robot))
