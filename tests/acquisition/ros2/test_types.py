"""Tests of message types of ROS 2."""

from __future__ import annotations

import struct
from contextlib import suppress
from types import SimpleNamespace as Message

import numpy as np
import pytest

from basecal.acquisition.ros2.types import dds_name, decode, encode, kind_of_dds, message_fields, type_hash
from basecal.errors import InputError

pytest.importorskip("rosbags")
KINDS = [
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/CameraInfo",
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/msg/String",
]


HASHES = {
    "sensor_msgs/msg/JointState": "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "std_msgs/msg/String": "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
}


@pytest.mark.parametrize("kind", HASHES)
def test_hashes_agree_with_another_program(kind):
    """ros2-pyterfaces 0.3, which knows the definitions, computes the same."""
    assert type_hash(kind) == HASHES[kind]


def joints(names=("a", "bcd"), effort=(1.0, 2.0)):
    header = Message(stamp=Message(sec=3, nanosec=5), frame_id="base")
    numbers = {"position": np.array([1.5, -2.5]), "velocity": np.zeros(0), "effort": np.array(effort)}
    return Message(header=header, name=list(names), **numbers)


def test_message_round_trip():
    """Names, numbers and byte order are kept: little-endian first, and big-endian is read, too."""
    data = encode("sensor_msgs/msg/JointState", joints())
    assert data[:12] == b"\x00\x01\x00\x00" + struct.pack("<iI", 3, 5)
    found = decode("sensor_msgs/msg/JointState", data)
    assert (found.header.stamp.sec, found.header.frame_id, found.name) == (3, "base", ["a", "bcd"])
    assert [found.position.tolist(), found.velocity.tolist(), found.effort.tolist()] == [[1.5, -2.5], [], [1.0, 2.0]]
    other = b"\x00\x00\x00\x00" + struct.pack(">iI", 3, 5) + struct.pack(">I", 2) + b"a\x00"
    header = decode("std_msgs/msg/Header", other)
    assert (header.stamp.sec, header.stamp.nanosec, header.frame_id) == (3, 5, "a")


def test_damaged_messages_are_errors():
    """A cut at any byte, counts beyond the end, and another serialisation are errors and never a crash."""
    kind = "sensor_msgs/msg/JointState"
    data = encode(kind, joints())
    for count in range(len(data)):
        with pytest.raises(InputError):
            decode(kind, data[:count])
    with pytest.raises(InputError, match="not in plain CDR"):
        decode(kind, b"\x00\x07" + data[2:])
    for place in range(4, len(data) - 4, 4):
        with suppress(InputError):
            decode(kind, data[:place] + struct.pack("<I", 2**31) + data[place + 4 :])


def test_names_on_the_wire_round_trip():
    """Names that are no messages of ROS 2 are refused."""
    assert dds_name("sensor_msgs/msg/JointState") == "sensor_msgs::msg::dds_::JointState_"
    assert [kind_of_dds(dds_name(kind)) for kind in KINDS] == KINDS
    assert kind_of_dds("std_srvs::srv::dds_::Empty_Request_") is None
    assert kind_of_dds("HelloWorld") is None


@pytest.mark.parametrize("kind", ["sensor_msgs/msg/Nothing", "no_such_msgs/msg/Image", "Image"])
def test_unknown_types_are_named(kind):
    """The error has their name."""
    with pytest.raises(InputError, match="no definition of the message"):
        message_fields(kind)
