"""Tests of robot states from ROS 2 topics."""

from __future__ import annotations

from types import SimpleNamespace as Message

import numpy as np
import pytest

from basecal.acquisition.ros2 import states as module
from basecal.acquisition.ros2.states import StatesByFrames, StatesByTopic
from basecal.errors import DriverError
from basecal.exchange.bags.bag import JOINTS, POSE


class FakeStream:
    """Topic with messages given by a test."""

    def __init__(self, name, domain, topic, kinds, depth, wait_s):
        self.name, self.topic, self.kind = name, topic, POSE if topic == "/pose" else JOINTS

    def messages(self, wait_s=0.0):
        return self.coming.pop(self.topic, [])

    def newest(self, read, is_mine=None):
        made = [given for given in map(read, self.messages()) if given is not None]
        if not made:
            raise DriverError(f"{self.name}: nothing")
        return made[-1]


@pytest.fixture
def coming(monkeypatch):
    monkeypatch.setattr(FakeStream, "coming", {}, raising=False)
    monkeypatch.setattr(module, "Stream", FakeStream)
    return FakeStream.coming


def header(stamp, frame="base"):
    return Message(stamp=Message(sec=int(stamp), nanosec=round(stamp % 1 * 1e9)), frame_id=frame)


def joints(stamp, **at):
    return Message(header=header(stamp), name=list(at), position=list(at.values()))


def frames(*hangs):
    """Message of tf with rows (stamp, parent, child, x)."""
    unturned = Message(x=0.0, y=0.0, z=0.0, w=1.0)
    return Message(
        transforms=[
            Message(
                header=header(stamp, parent),
                child_frame_id=child,
                transform=Message(translation=Message(x=x, y=0.0, z=0.0), rotation=unturned),
            )
            for stamp, parent, child, x in hangs
        ]
    )


def test_joints_are_in_the_order_of_the_urdf(coming):
    """Other joints of the message are ignored; messages of a gripper alone are skipped."""
    states = StatesByTopic("eye", 0, "/joint_states", ["a", "b"], 0.0)
    coming["/joint_states"] = [joints(1.0, b=2.0, grip=9.0, a=1.0), joints(1.5, grip=8.0)]
    reading = states.next()
    assert (reading.stamp_s, reading.state.joints_rad.tolist()) == (1.0, [1.0, 2.0])


def test_late_messages_are_skipped(coming):
    """Reordered and repeated messages are never returned after newer ones."""
    states = StatesByTopic("eye", 0, "/joint_states", ["a"], 0.0)
    coming["/joint_states"] = [joints(2.0, a=2.0), joints(1.0, a=1.0), joints(2.0, a=2.0)]
    assert states.next().stamp_s == 2.0
    coming["/joint_states"] = [joints(1.5, a=1.5)]
    with pytest.raises(DriverError, match="eye: nothing"):
        states.next()


def test_zero_stamp_is_refused(coming):
    """Non-finite values are left to the common check of all drivers."""
    states = StatesByTopic("eye", 0, "/joint_states", ["a"], 0.0)
    coming["/joint_states"] = [joints(0.0, a=2.0)]
    with pytest.raises(DriverError):
        states.next()
    coming["/joint_states"] = [joints(1.0, a=np.nan)]
    assert np.isnan(states.next().state.joints_rad[0])


def test_pose_is_read_unchanged(coming):
    """It keeps its stamp."""
    pose = Message(position=Message(x=1.0, y=2.0, z=3.0), orientation=Message(x=0.0, y=0.0, z=1.0, w=0.0))
    coming["/pose"] = [Message(header=header(4.0), pose=pose)]
    reading = StatesByTopic("eye", 0, "/pose", [], 0.0).next()
    np.testing.assert_allclose(reading.state.base_from_flange.translation, [1, 2, 3])
    assert reading.state.base_from_flange.rotation[0, 0] == -1


def test_frames_of_a_chain_have_one_stamp(coming):
    """Frames that arrive separately are combined once all have the same time."""
    states = StatesByFrames("eye", 0, "base", "tip", 0.0)
    coming["/tf_static"] = [frames((0.0, "arm", "tip", 0.25))]
    coming["/tf"] = [frames((1.0, "base", "link", 1.0)), frames((1.1, "link", "arm", 2.0))]
    with pytest.raises(DriverError, match="eye: nothing"):
        states.next()
    coming["/tf"] = [frames((1.1, "base", "link", 1.5))]
    reading = states.next()
    assert reading.stamp_s == 1.1
    np.testing.assert_allclose(reading.state.base_from_flange.translation, [3.75, 0, 0])


def test_unconnected_frames_are_reported(coming):
    """The message names their parents."""
    states = StatesByFrames("eye", 0, "base", "tip", 0.0)
    coming["/tf"] = [frames((1.0, "base", "link", 1.0), (1.0, "world", "tip", 1.0))]
    with pytest.raises(DriverError, match="eye: no transform of tf joins 'base' and 'tip'"):
        states.next()
