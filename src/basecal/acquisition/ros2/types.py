"""Types of ROS 2's messages: their fields, their names in DDS and their hashes, by ros2-pyterfaces."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Any

from basecal.errors import InputError, MissingExtra

Fields = Mapping[str, Any]
"""Of a message by name: the name of a primitive, a `Sequence` or an `Array` of one, or the fields of a message."""

_TYPENAME = "__typename"


@cache
def core() -> Any:
    """The definitions, in plain Python.

    Raises:
        MissingExtra: if they are not installed.
    """
    try:
        return import_module("ros2_pyterfaces.core")
    except ImportError:
        raise MissingExtra("ros2", "talking to ROS 2") from None


@cache
def fields_of(kind: str) -> Fields:
    """Fields of a message such as `sensor_msgs/msg/JointState`, in their order; it says its own name as well.

    Raises:
        InputError: if no such type is known.
    """
    core()
    package, _, name = kind.partition("/msg/")
    try:
        if (package, name) == ("tf2_msgs", "TFMessage"):  # which the definitions leave out
            return {_TYPENAME: kind, "transforms": core().Sequence(fields_of("geometry_msgs/msg/TransformStamped"))}
        found: Fields = getattr(import_module(f"ros2_pyterfaces.core.{package}.msg"), name)
    except (ImportError, AttributeError):
        raise InputError(f"no definition of the message {kind!r} is known") from None
    return found


def name_of(fields: Fields) -> str:
    """The name of the type of a message: `sensor_msgs/msg/JointState`."""
    return str(fields[_TYPENAME])


def members(fields: Fields) -> dict[str, Any]:
    """Fields without the name of the type."""
    return {name: kind for name, kind in fields.items() if name != _TYPENAME}


def dds_name(kind: str) -> str:
    """A type's name on the wire: `sensor_msgs::msg::dds_::JointState_`."""
    package, _, name = kind.partition("/msg/")
    return f"{package}::msg::dds_::{name}_"


def kind_of_dds(name: str) -> str | None:
    """The type of a name on the wire; None where it is none of ROS 2's messages."""
    package, _, rest = name.partition("::msg::dds_::")
    return f"{package}/msg/{rest[:-1]}" if rest.endswith("_") else None


@cache
def type_hash(kind: str) -> str:
    """What ROS 2 tells a type apart by: `RIHS01_` and a SHA-256 of its definition."""
    return str(core().hash_rihs01(fields_of(kind)))
