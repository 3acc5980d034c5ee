"""Ways of robots: who goes where, and when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import RobotState
from basecal.errors import FrameNotFound, InputError
from basecal.exchange.motions.way import make_path
from basecal.geometry import SE3
from shared.motion_ways import ARMS, HOLD_S, SPEED_RAD_S, joint_way, planned_joints, pose_way


def test_no_joint_is_faster_than_asked() -> None:
    """Between stops a cubic from rest to rest has its peak, 1.5 times the mean speed, at the limit or below."""
    way = joint_way()
    ways_rad = np.max([np.abs(np.diff(planned_joints(way, robot), axis=0)).max(-1) for robot in way.robots], axis=0)
    times_s = np.diff(way.arrivals_s) - HOLD_S
    assert np.allclose(1.5 * ways_rad / times_s, SPEED_RAD_S)
    assert way.arrivals_s[0] == pytest.approx(1.5 * np.pi / SPEED_RAD_S)


def test_one_robot_or_all() -> None:
    """A program for one arm asks which of several; a robot that is none is named with those that are."""
    assert list(joint_way().robots) == ["eye", "hand"]
    assert joint_way("hand").single_robot() == "hand"
    with pytest.raises(InputError, match=r"--robot: eye, hand"):
        joint_way().single_robot()
    with pytest.raises(FrameNotFound, match="hand"):
        make_path(ARMS.cell, ARMS.recording.samples, "han")


def test_poses_have_no_joints() -> None:
    """Joints of a robot known by poses are refused with what would help; its poses are as planned."""
    way = pose_way()
    with pytest.raises(InputError, match="Add urdf"):
        way.joints("hand")
    assert np.allclose(way.pose("hand", way.samples[1]).translation, [0.4, 0, 0.1])


def test_poses_beside_joints_are_poses() -> None:
    """A robot with a chain but without joints in a sample is planned with poses, and so is one without a chain."""
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
def test_arms_that_do_not_move_stay_as_long_as_they_rest(count: int) -> None:
    """The first motion may be half a turn; each further sample takes the time at rest."""
    still = replace(joint_way(), samples=joint_way().samples[:1] * count, hold_s=4.0, speed_rad_s=0.25)
    first_s = 1.5 * np.pi / 0.25
    assert still.arrivals_s == pytest.approx([first_s + 4.0 * k for k in range(count)])


def test_ways_are_slow_unless_stated() -> None:
    """Half a radian a second, with two seconds at rest; robots are those that all samples have."""
    samples = joint_way().samples
    way = make_path(ARMS.cell, samples)
    assert (way.speed_rad_s, way.hold_s, list(way.robots)) == (0.5, 2.0, ["eye", "hand"])
    alone = replace(samples[1], robots={"hand": samples[1].robots["hand"]})
    assert list(make_path(ARMS.cell, [samples[0], alone]).robots) == ["hand"]
