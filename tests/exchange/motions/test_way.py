"""Tests of robot paths: which robot goes to which sample, and when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import RobotState
from basecal.errors import FrameNotFound, InputError
from basecal.exchange.motions.way import make_path
from basecal.geometry import SE3
from shared.motion_ways import ARMS, HOLD_S, SPEED_RAD_S, joint_way, planned_joints, pose_way


def test_joint_speed_stays_within_limit() -> None:
    """A cubic from rest to rest between stops peaks at 1.5 times the mean speed, which is at most the limit."""
    way = joint_way()
    ways_rad = np.max([np.abs(np.diff(planned_joints(way, robot), axis=0)).max(-1) for robot in way.robots], axis=0)
    times_s = np.diff(way.arrivals_s) - HOLD_S
    assert np.allclose(1.5 * ways_rad / times_s, SPEED_RAD_S)
    assert way.arrivals_s[0] == pytest.approx(1.5 * np.pi / SPEED_RAD_S)


def test_path_for_one_or_all_robots() -> None:
    """A program for one arm requires a choice of robot; an unknown robot is reported with the known ones."""
    assert list(joint_way().robots) == ["eye", "hand"]
    assert joint_way("hand").single_robot() == "hand"
    with pytest.raises(InputError, match=r"--robot: eye, hand"):
        joint_way().single_robot()
    with pytest.raises(FrameNotFound, match="hand"):
        make_path(ARMS.cell, ARMS.recording.samples, "han")


def test_robot_of_poses_has_no_joints() -> None:
    """Joints of a robot known by poses are refused with a remedy; its poses are as planned."""
    way = pose_way()
    with pytest.raises(InputError, match="Add urdf"):
        way.joints("hand")
    assert np.allclose(way.pose("hand", way.samples[1]).translation, [0.4, 0, 0.1])


def test_robot_with_incomplete_joints_is_planned_by_poses() -> None:
    """A robot with a chain but without joints in one sample is planned by poses, and so is one without a chain."""
    way = joint_way()
    without = [replace(way.samples[0], robots={**way.samples[0].robots, "eye": RobotState(SE3.identity())})]
    some = replace(way, samples=(*way.samples[1:], *without))
    assert not some.has_joints("eye")
    assert some.has_joints("hand")
    with pytest.raises(InputError, match="eye is planned with poses, its joints are unknown"):
        some.joint_names("eye")
    chainless = replace(way, robots={"eye": replace(way.robots["eye"], chain=None)})
    with pytest.raises(InputError, match="eye is planned with poses, its joints are unknown"):
        chainless.joint_names("eye")


@pytest.mark.parametrize("count", [1, 2, 3])
def test_stationary_arms_wait_hold_time(count: int) -> None:
    """The first motion may be half a turn; each further sample takes the time at rest."""
    still = replace(joint_way(), samples=joint_way().samples[:1] * count, hold_s=4.0, speed_rad_s=0.25)
    first_s = 1.5 * np.pi / 0.25
    assert still.arrivals_s == pytest.approx([first_s + 4.0 * k for k in range(count)])


def test_default_path_speed_and_hold() -> None:
    """Defaults are half a radian per second and two seconds at rest, for robots that all samples have."""
    samples = joint_way().samples
    way = make_path(ARMS.cell, samples)
    assert (way.speed_rad_s, way.hold_s, list(way.robots)) == (0.5, 2.0, ["eye", "hand"])
    alone = replace(samples[1], robots={"hand": samples[1].robots["hand"]})
    assert list(make_path(ARMS.cell, [samples[0], alone]).robots) == ["hand"]
