"""Types of ROS 2's messages: their fields, names in DDS, hashes and bytes, by rosbags."""

from __future__ import annotations

from functools import cache
from typing import Any

from basecal.errors import InputError, MissingExtra


@cache
def typestore() -> Any:
    """The definitions of ROS 2.

    Raises:
        MissingExtra: if they are not installed.
    """
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtra("ros2", "talking to ROS 2") from None
    return get_typestore(Stores.ROS2_JAZZY)


def message_fields(kind: str) -> tuple[tuple[str, Any], ...]:
    """Names and kinds of the fields of a message such as `sensor_msgs/msg/JointState`, as rosbags has them.

    Raises:
        InputError: if no such type is known.
    """
    if kind not in typestore().fielddefs:
        raise InputError(f"no definition of the message {kind!r} is known")
    fields: tuple[tuple[str, Any], ...] = tuple(typestore().fielddefs[kind][1])
    return fields


def decode(kind: str, data: bytes) -> Any:
    """A message of plain CDR with its fields as attributes; primitives in sequences and arrays are NumPy's.

    Raises:
        InputError: if the bytes end too early, or are of another serialisation.
    """
    from rosbags.serde import SerdeError

    if data[:1] != b"\0" or data[1:2] not in (b"\0", b"\1"):
        raise InputError("a message is not in plain CDR, which is all that ROS 2 sends")
    try:
        return typestore().deserialize_cdr(memoryview(data), kind)
    except (SerdeError, ValueError):
        raise InputError("a message ends too early: its type is not the one that it is sent as") from None


def encode(kind: str, message: Any) -> bytes:
    """A message as bytes of plain CDR; sequences of primitives are NumPy's."""
    return bytes(typestore().serialize_cdr(message, kind))


def dds_name(kind: str) -> str:
    """A type's name on the wire: `sensor_msgs::msg::dds_::JointState_`."""
    package, _, name = kind.partition("/msg/")
    return f"{package}::msg::dds_::{name}_"


def kind_of_dds(name: str) -> str | None:
    """The type of a name on the wire; None if it is none of ROS 2's messages."""
    package, _, rest = name.partition("::msg::dds_::")
    return f"{package}/msg/{rest[:-1]}" if rest.endswith("_") else None


@cache
def type_hash(kind: str) -> str:
    """The identifier of a type in ROS 2: `RIHS01_` and a SHA-256 of its definition."""
    return str(typestore().hash_rihs01(kind))
