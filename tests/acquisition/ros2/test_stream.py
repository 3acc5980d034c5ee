"""Tests of following a topic."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from basecal.acquisition.ros2 import stream as module
from basecal.acquisition.ros2.dds import PublishedTopic
from basecal.acquisition.ros2.stream import Stream, stamp_s
from basecal.errors import DriverError

pytest.importorskip("rosbags")
TEXT = "std_msgs/msg/String"


@pytest.fixture
def network(monkeypatch):
    """Offered topics and their messages, as lists that a test fills."""
    there = SimpleNamespace(topics={"/text": PublishedTopic("/text", TEXT, True, False, "")}, coming=[], sender=1)
    discovery = SimpleNamespace(topics=lambda: there.topics, wait_for_topic=lambda name, wait_s: there.topics.get(name))
    there.publishers = {1: "driver 10 on cell", 2: "player 11 on cell"}

    def received(wait_s):
        return [(there.sender, each) for each in (there.coming.pop(0) if there.coming else [])]

    listener = SimpleNamespace(receive=received, publishers=lambda: there.publishers)
    monkeypatch.setattr(module, "Discovery", lambda domain: discovery)
    monkeypatch.setattr(module, "Subscriber", lambda *_: listener)
    monkeypatch.setattr(module, "STALE_S", 0.01)
    return there


def test_newest_usable_message_is_returned(network):
    """It waits for one, and gets all messages in the order of their arrival."""
    network.coming = [[], [1], [2, 4, 5, 6, 7]]
    seen = []
    stream = Stream("eye", 0, "/text", (TEXT,), 5, 1.0)
    assert stream.newest(lambda each: (seen.append(each), each if each % 2 == 0 else None)[1]) == 6
    assert seen == [1, 2, 4, 5, 6, 7]


def test_foreign_message_definition_is_refused(network):
    """A custom JointState would be read wrongly."""
    network.topics["/text"] = PublishedTopic("/text", TEXT, True, False, "RIHS01_00")
    with pytest.raises(DriverError, match="/text has another definition of std_msgs/msg/String"):
        Stream("eye", 0, "/text", (TEXT,), 5, 1.0)


def test_missing_messages_are_reported_with_their_cause(network):
    """Old messages, silence, and a vanished publisher are distinguished."""
    stream = Stream("eye", 0, "/text", (TEXT,), 5, 0.0)
    network.coming = [[1, 2]]
    with pytest.raises(DriverError, match="eye: stale stamps: 2 messages came on /text"):
        stream.newest(lambda each: None)
    with pytest.raises(DriverError, match=r"eye: no message came on /text .* although it has a publisher"):
        stream.newest(lambda each: each)
    network.topics.clear()
    with pytest.raises(DriverError, match="eye: /text has no publisher any more"):
        stream.newest(lambda each: each)


def test_second_publisher_is_refused(network):
    """Two live publishers are named; a restarted one counts once, and tf may have many."""
    stream = Stream("eye", 0, "/text", (TEXT,), 5, 0.0)
    for sender, publishers in ((1, {1: "a"}), (2, {2: "a"}), (3, {3: "a"})):
        network.sender, network.publishers, network.coming = sender, publishers, [[sender]]
        assert stream.newest(lambda each: each, lambda each: True) == sender
    network.sender, network.publishers, network.coming = 1, {1: "driver 10 on cell", 3: "player 11 on cell"}, [[4], [5]]
    assert stream.newest(lambda each: each) == 4
    with pytest.raises(DriverError, match="eye: 2 publishers send /text: driver 10 on cell, player 11 on cell"):
        stream.newest(lambda each: each, lambda each: True)


def test_stamp_is_in_seconds():
    """It is computed from seconds and nanoseconds."""
    assert stamp_s(SimpleNamespace(stamp=SimpleNamespace(sec=3, nanosec=500_000_000))) == 3.5
