"""Tests of a bag's topics and messages, and of files that are no bags."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, KINDS, Kind, new_bag

from basecal.errors import DatasetError, MissingExtra
from basecal.exchange.bags.bag import JOINTS, message_time, open_bag


@pytest.mark.parametrize("kind", KINDS)
def test_topics_and_messages_are_read(kind: Kind, tmp_path: Path) -> None:
    """Topics have their message counts and types, and messages are read in time order with their values."""
    writer = new_bag(tmp_path, kind)
    for k in range(3):
        writer.joints("/joint_states", BEGIN_S + k, ["a", "b"], np.array([k, -k], dtype=float))
    writer.text("/robot_description", "<robot/>")
    with open_bag(writer.close()) as bag:
        assert {topic.name: topic.messages for topic in bag.topics.values()} == {
            "/joint_states": 3,
            "/robot_description": 1,
        }
        assert [topic.name for topic in bag.topics_of_type(JOINTS)] == ["/joint_states"]
        found = list(bag.read(["/joint_states"]))
        assert [message_time(message.data.header, 0.0) for message in found] == [BEGIN_S, BEGIN_S + 1, BEGIN_S + 2]
        assert found[2].data.position.tolist() == [2.0, -2.0]
        assert list(bag.read(["/nothing"])) == []


def test_header_without_time_uses_recording_time(tmp_path: Path) -> None:
    """A message whose header has no time has the time of its recording."""
    writer = new_bag(tmp_path, "mcap")
    assert message_time(writer.header(0.0), 7.5) == 7.5


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.bag", None, "there is no such bag"),
        ("a.txt", b"", "is not a bag: unknown file name extension"),
        ("a.bag", b"", "is damaged or was cut off"),
        ("a.bag", b"#ROSBAG V1.2\n", "is damaged or was cut off"),
        ("a.db3", b"SQLite format 3\0", "is damaged or was cut off"),
        ("a.mcap", b"\x89MCAP0\r\n", "is damaged or was cut off"),
    ],
)
def test_invalid_bags_are_reported(name: str, content: bytes | None, message: str, tmp_path: Path) -> None:
    """A missing, foreign or damaged bag is an error on one line."""
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(DatasetError, match=message) as error, open_bag(tmp_path / name):
        pass
    assert "\n" not in str(error.value)


def test_folder_without_metadata_names_its_file(tmp_path: Path) -> None:
    """The error for a folder without metadata names the bag file in it."""
    (tmp_path / "x_0.mcap").touch()
    with pytest.raises(DatasetError, match=r"give the file in it: x_0\.mcap"), open_bag(tmp_path):
        pass


def test_missing_bag_support_names_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """If rosbags is not installed the error names the extra `basecal[bags]`."""
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(MissingExtra, match=r"basecal\[bags\]"), open_bag(tmp_path):
        pass
