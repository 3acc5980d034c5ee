"""Ways of robots: who goes where, and when."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import FrameNotFound, InputError
from basecal.exchange.motions.way import make_way
from shared.motion_ways import ARMS, HOLD_S, SPEED_RAD_S, joints_of, of_joints, of_poses


def test_no_joint_is_faster_than_asked() -> None:
    """Between stops a cubic from rest to rest has its peak, 1.5 times the mean speed, at the limit or below."""
    way = of_joints()
    ways_rad = np.max([np.abs(np.diff(joints_of(way, robot), axis=0)).max(-1) for robot in way.robots], axis=0)
    times_s = np.diff(way.arrivals_s) - HOLD_S
    assert np.allclose(1.5 * ways_rad / times_s, SPEED_RAD_S)
    assert way.arrivals_s[0] == pytest.approx(1.5 * np.pi / SPEED_RAD_S)


def test_one_robot_or_all() -> None:
    """A program for one arm asks which of several; a robot that is none is named with those that are."""
    assert list(of_joints().robots) == ["eye", "hand"]
    assert of_joints("hand").single_robot() == "hand"
    with pytest.raises(InputError, match=r"--robot: eye, hand"):
        of_joints().single_robot()
    with pytest.raises(FrameNotFound, match="hand"):
        make_way(ARMS.cell, ARMS.recording.samples, "han")


def test_poses_have_no_joints() -> None:
    """Joints of a robot known by poses are refused with what would help; its poses are as planned."""
    way = of_poses()
    with pytest.raises(InputError, match="Add urdf"):
        way.joints("hand")
    assert np.allclose(way.pose("hand", way.samples[1]).translation, [0.4, 0, 0.1])
