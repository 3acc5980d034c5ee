"""Message types of ROS 2 with rosbags: fields, names in DDS, hashes and serialisation."""

from __future__ import annotations

from functools import cache
from typing import Any

from basecal.errors import InputError, MissingExtra


@cache
def typestore() -> Any:
    """Message definitions of ROS 2 Jazzy.

    Raises:
        MissingExtra: if rosbags is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtra("ros2", "talking to ROS 2") from None
    return get_typestore(Stores.ROS2_JAZZY)


def message_fields(kind: str) -> tuple[tuple[str, Any], ...]:
    """Names and kinds of the fields of a message such as `sensor_msgs/msg/JointState`, in the format of rosbags.

    Raises:
        InputError: if the type is unknown.
    """
    if kind not in typestore().fielddefs:
        raise InputError(f"no definition of the message {kind!r} is known")
    fields: tuple[tuple[str, Any], ...] = tuple(typestore().fielddefs[kind][1])
    return fields


def decode(kind: str, data: bytes) -> Any:
    """Decode a message from plain CDR; its attributes are the fields, with NumPy arrays for sequences of primitives.

    Raises:
        InputError: if the bytes end too early, or use another serialisation.
    """
    from rosbags.serde import SerdeError

    if data[:1] != b"\0" or data[1:2] not in (b"\0", b"\1"):
        raise InputError("a message is not in plain CDR, which is all that ROS 2 sends")
    try:
        return typestore().deserialize_cdr(memoryview(data), kind)
    except (SerdeError, ValueError):
        raise InputError("a message ends too early: it does not match its type") from None


def encode(kind: str, message: Any) -> bytes:
    """Encode a message as plain CDR; sequences of primitives are NumPy arrays."""
    return bytes(typestore().serialize_cdr(message, kind))


def dds_name(kind: str) -> str:
    """Name of a message type in DDS, such as `sensor_msgs::msg::dds_::JointState_`."""
    package, _, name = kind.partition("/msg/")
    return f"{package}::msg::dds_::{name}_"


def kind_of_dds(name: str) -> str | None:
    """Message type of a name in DDS; None if the name is not a ROS 2 message type."""
    package, _, rest = name.partition("::msg::dds_::")
    return f"{package}/msg/{rest[:-1]}" if rest.endswith("_") else None


@cache
def type_hash(kind: str) -> str:
    """Type hash in ROS 2: `RIHS01_` and the SHA-256 of the type's definition."""
    return str(typestore().hash_rihs01(kind))
