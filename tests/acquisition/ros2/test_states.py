"""Where a robot is, by what comes on its topics."""

from __future__ import annotations

from types import SimpleNamespace as Message

import numpy as np
import pytest

from basecal.acquisition.ros2 import states as module
from basecal.acquisition.ros2.states import StatesByFrames, StatesByTopic
from basecal.errors import DriverError
from basecal.exchange.bags.bag import JOINTS, POSE


class FakeStream:
    """A topic whose messages a test says."""

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
    """A message of tf, of (stamp, parent, child, x)."""
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
    """Whatever else is in the message; messages of a gripper alone are passed over."""
    states = StatesByTopic("eye", 0, "/joint_states", ["a", "b"], 0.0)
    coming["/joint_states"] = [joints(1.0, b=2.0, grip=9.0, a=1.0), joints(1.5, grip=8.0)]
    reading = states.next()
    assert (reading.stamp_s, reading.state.joints_rad.tolist()) == (1.0, [1.0, 2.0])


def test_late_messages_are_passed_over(coming):
    """What a network brings in another order, and twice, is never given after something newer."""
    states = StatesByTopic("eye", 0, "/joint_states", ["a"], 0.0)
    coming["/joint_states"] = [joints(2.0, a=2.0), joints(1.0, a=1.0), joints(2.0, a=2.0)]
    assert states.next().stamp_s == 2.0
    coming["/joint_states"] = [joints(1.5, a=1.5)]
    with pytest.raises(DriverError, match="eye: nothing"):
        states.next()


def test_joints_without_stamps_or_numbers(coming):
    """A stamp of zero is none; what is not finite is left to the one check of all drivers."""
    states = StatesByTopic("eye", 0, "/joint_states", ["a"], 0.0)
    coming["/joint_states"] = [joints(0.0, a=2.0)]
    with pytest.raises(DriverError):
        states.next()
    coming["/joint_states"] = [joints(1.0, a=np.nan)]
    assert np.isnan(states.next().state.joints_rad[0])


def test_a_pose_is_taken_as_it_is(coming):
    """With its stamp."""
    pose = Message(position=Message(x=1.0, y=2.0, z=3.0), orientation=Message(x=0.0, y=0.0, z=1.0, w=0.0))
    coming["/pose"] = [Message(header=header(4.0), pose=pose)]
    reading = StatesByTopic("eye", 0, "/pose", [], 0.0).next()
    np.testing.assert_allclose(reading.state.base_from_flange.translation, [1, 2, 3])
    assert reading.state.base_from_flange.rotation[0, 0] == -1


def test_frames_of_one_way_have_one_stamp(coming):
    """Frames that come one after the other are joined once all of them are of one time."""
    states = StatesByFrames("eye", 0, "base", "tip", 0.0)
    coming["/tf_static"] = [frames((0.0, "arm", "tip", 0.25))]
    coming["/tf"] = [frames((1.0, "base", "link", 1.0)), frames((1.1, "link", "arm", 2.0))]
    with pytest.raises(DriverError, match="eye: nothing"):
        states.next()
    coming["/tf"] = [frames((1.1, "base", "link", 1.5))]
    reading = states.next()
    assert reading.stamp_s == 1.1
    np.testing.assert_allclose(reading.state.base_from_flange.translation, [3.75, 0, 0])


def test_frames_that_nothing_joins(coming):
    """It says what they hang on."""
    states = StatesByFrames("eye", 0, "base", "tip", 0.0)
    coming["/tf"] = [frames((1.0, "base", "link", 1.0), (1.0, "world", "tip", 1.0))]
    with pytest.raises(DriverError, match="eye: no transform of tf joins 'base' and 'tip'"):
        states.next()
