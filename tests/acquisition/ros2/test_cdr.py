"""Messages to bytes and back, against rosbags' serialisation."""

from __future__ import annotations

import struct
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.acquisition.ros2.cdr import decoded, encoded
from basecal.acquisition.ros2.types import fields_of, members, name_of
from basecal.errors import InputError

pytest.importorskip("ros2_pyterfaces")
typesys = pytest.importorskip("rosbags.typesys")
STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
NUMBERS = {"bool": "?", "byte": "u1", "char": "u1"}


def drawn(rng, kind):
    """A message of a type with values at random, its fields as attributes, for us and for rosbags."""
    fields = fields_of(kind) if isinstance(kind, str) else kind
    values = {name: value(rng, each) for name, each in members(fields).items()}
    ours = SimpleNamespace(**{name: each[0] for name, each in values.items()})
    return ours, STORE.types[name_of(fields)](**{name: each[1] for name, each in values.items()})


def value(rng, kind):
    if kind == "string":
        word = "".join(rng.choice(list("aé_z"), rng.integers(0, 6)))
        return word, word
    if isinstance(kind, str):
        number = numbers(rng, kind, 1)[0].item()
        return number, number
    if isinstance(kind, dict):
        return drawn(rng, kind)
    count = getattr(kind, "length", None) or int(rng.integers(0, 4))
    if isinstance(kind.subtype, str) and kind.subtype != "string":
        many = numbers(rng, kind.subtype, count)
        return many, many
    pairs = [value(rng, kind.subtype) for _ in range(count)]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]


def numbers(rng, kind, count):
    code = np.dtype(NUMBERS.get(kind, kind))
    if code.kind == "f":
        return rng.standard_normal(count).astype(code)
    if code.kind == "b":
        return rng.integers(0, 2, count).astype(bool)
    return rng.integers(np.iinfo(code).min, np.iinfo(code).max, count, dtype=code, endpoint=True)


def same(one, other):
    """Whether two messages say the same."""
    if isinstance(one, SimpleNamespace):
        return all(same(each, getattr(other, name)) for name, each in vars(one).items())
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    return np.array_equal(one, other)


@pytest.mark.parametrize(
    "kind",
    [
        "sensor_msgs/msg/JointState",
        "sensor_msgs/msg/Image",
        "sensor_msgs/msg/CompressedImage",
        "sensor_msgs/msg/CameraInfo",
        "tf2_msgs/msg/TFMessage",
        "geometry_msgs/msg/PoseStamped",
        "std_msgs/msg/String",
    ],
)
def test_bytes_are_those_of_rosbags(kind):
    """Of messages drawn at random, whatever their lengths and alignments; and they are read back as they were."""
    rng = np.random.default_rng(0)
    for _ in range(30):
        ours, theirs = drawn(rng, kind)
        data = bytes(STORE.serialize_cdr(theirs, kind))
        assert encoded(fields_of(kind), ours) == data
        assert same(ours, decoded(fields_of(kind), data))


def test_the_other_order_of_bytes_is_read():
    """A computer that writes the highest byte first is understood."""
    data = b"\x00\x00\x00\x00" + struct.pack(">iI", 3, 5) + struct.pack(">I", 2) + b"a\x00"
    header = decoded(fields_of("std_msgs/msg/Header"), data)
    assert (header.stamp.sec, header.stamp.nanosec, header.frame_id) == (3, 5, "a")


def test_damaged_messages_are_told():
    """Cut at any byte, with counts beyond the end, or in another serialisation, it is an error and never a crash."""
    fields = fields_of("sensor_msgs/msg/JointState")
    ours, _ = drawn(np.random.default_rng(1), "sensor_msgs/msg/JointState")
    ours.name = ["a", "bcd"]
    ours.effort = np.ones(3)
    data = encoded(fields, ours)
    for count in range(len(data)):
        with pytest.raises(InputError):
            decoded(fields, data[:count])
    with pytest.raises(InputError, match="not in plain CDR"):
        decoded(fields, b"\x00\x07" + data[2:])
    huge = data[:4] + data[4:12] + struct.pack("<I", 2**31) + data[16:]
    with pytest.raises(InputError, match="ends too early"):
        decoded(fields, huge)
