"""Goals of ROS 2."""

from __future__ import annotations

import numpy as np
import pytest
from ruamel.yaml import YAML

from basecal.errors import InputError
from basecal.exchange.motions.ros2_trajectory import write_motion
from shared.motion_ways import HOLD_S, joints_of, of_joints, of_poses


def test_goals_are_in_step() -> None:
    """A document for each arm with the fields of JointTrajectory; all are at each sample at once, and hold."""
    way = of_joints()
    goals = [each["trajectory"] for each in YAML(typ="safe", pure=True).load_all(write_motion(way))]
    assert len(goals) == 2
    times = []
    for robot, goal in zip(way.robots, goals, strict=True):
        assert tuple(goal["joint_names"]) == way.joint_names(robot)
        points = goal["points"]
        assert np.allclose([p["positions"] for p in points], np.repeat(joints_of(way, robot), 2, axis=0), atol=1e-8)
        assert not np.any([p["velocities"] for p in points])
        times.append([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points])
    assert times[0] == times[1]
    assert np.allclose(np.diff(times[0])[::2], HOLD_S)
    assert np.all(np.diff(times[0]) > 0)


def test_poses_are_refused() -> None:
    """A trajectory is of joints."""
    with pytest.raises(InputError, match="joints are not known"):
        write_motion(of_poses())
