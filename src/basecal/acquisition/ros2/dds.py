"""Topics of ROS 2 over DDS with cyclonedds: discovery, subscription and publication.

ROS 2 maps the topic `/joint_states` to `rt/joint_states`, and its type to `sensor_msgs::msg::dds_::JointState_`. The
type's hash is in the publisher's user data. A reader requests the offered reliability and durability, so that the QoS
settings always match.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

from basecal.acquisition.ros2.types import dds_name, decode, encode, kind_of_dds, message_fields, type_hash, typestore
from basecal.errors import InputError, MissingExtra

_TOPIC_PREFIX = "rt/"  # prefix of topics of ROS 2
_HASH_KEY = "typehash="
LAST_DOMAIN = 232
"""Largest domain ID: for larger ones, DDS ports would exceed 65535."""
_NS_PER_MS = 1_000_000
_POLL_S = 0.05  # polling period of discovery
_MOST_MESSAGES = 2000  # messages taken at once
_HANDLE_COUNT = 2**64  # number of publisher handles, one of which cyclonedds returns as a signed number


@dataclass(frozen=True)
class PublishedTopic:
    """A published topic.

    Attributes:
        name: Name in ROS 2, such as `/joint_states`.
        kind: Type of the messages, such as `sensor_msgs/msg/JointState`.
        is_reliable: Whether all publishers offer reliable delivery.
        is_latched: Whether all publishers offer transient-local durability.
        type_hash: Hash of the type from the publisher; empty before ROS 2 Iron.
    """

    name: str
    kind: str
    is_reliable: bool
    is_latched: bool
    type_hash: str


@cache
def participant(domain: int) -> Any:
    """The DDS participant of this process in a domain.

    Raises:
        MissingExtra: if cyclonedds is not installed.
        InputError: if DDS finds no usable network.
    """
    typestore()
    try:
        from cyclonedds.core import DDSException
        from cyclonedds.domain import DomainParticipant
    except ImportError:
        raise MissingExtra("ros2", "talking to ROS 2") from None
    try:
        return DomainParticipant(domain)
    except DDSException as error:
        raise InputError(f"DDS cannot be used in domain {domain}: {error}; look at CYCLONEDDS_URI") from None


def choose_domain(domain: int | None) -> int:
    """The stated domain ID, else the value of the variable ROS_DOMAIN_ID, else 0.

    Raises:
        InputError: if the variable is not a valid domain ID.
    """
    if domain is not None:
        return domain
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not (text.isdecimal() and int(text) <= LAST_DOMAIN):
        raise InputError(f"ROS_DOMAIN_ID is {text!r}: expected a number from 0 to {LAST_DOMAIN}")
    return int(text)


def describe_domain(domain: int) -> str:
    """Description of a domain for messages."""
    return f"ROS 2 in domain {domain}, by DDS on all networks of this computer"


class Discovery:
    """Discovery of the published topics in a domain."""

    def __init__(self, domain: int) -> None:
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication

        self._reader = BuiltinDataReader(participant(domain), BuiltinTopicDcpsPublication)

    def topics(self) -> dict[str, PublishedTopic]:
        """Published topics by name."""
        topics: dict[str, PublishedTopic] = {}
        for endpoint in self._reader.read(_MOST_MESSAGES):
            topic = _published_topic(endpoint)
            previous = None if topic is None else topics.get(topic.name)
            if topic is not None and previous is not None:
                topic = PublishedTopic(
                    topic.name,
                    topic.kind,
                    topic.is_reliable and previous.is_reliable,
                    topic.is_latched and previous.is_latched,
                    topic.type_hash or previous.type_hash,
                )
            if topic is not None:
                topics[topic.name] = topic
        return topics

    def wait_for_topic(self, name: str, wait_s: float) -> PublishedTopic | None:
        """Wait for a topic; None if it is not published before the timeout [s]."""
        deadline_s = time.monotonic() + wait_s
        while (topic := self.topics().get(name)) is None and time.monotonic() < deadline_s:
            time.sleep(_POLL_S)
        return topic


def _published_topic(endpoint: Any) -> PublishedTopic | None:
    from cyclonedds.core import Policy

    kind = kind_of_dds(endpoint.type_name or "")
    if kind is None or not endpoint.topic_name.startswith(_TOPIC_PREFIX) or not endpoint.sample_info.valid_data:
        return None
    qos = endpoint.qos
    user_data = bytes(qos[Policy.Userdata].data).decode(errors="replace") if Policy.Userdata in qos else ""
    hashes = [part.removeprefix(_HASH_KEY) for part in user_data.split(";") if part.startswith(_HASH_KEY)]
    return PublishedTopic(
        "/" + endpoint.topic_name.removeprefix(_TOPIC_PREFIX),
        kind,
        isinstance(qos[Policy.Reliability], Policy.Reliability.Reliable) if Policy.Reliability in qos else False,
        Policy.Durability in qos and qos[Policy.Durability] == Policy.Durability.TransientLocal,
        (hashes or [""])[0],
    )


class Subscriber:
    """Subscriber of a topic."""

    def __init__(self, domain: int, topic: PublishedTopic, depth: int) -> None:
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsParticipant
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
        from cyclonedds.sub import DataReader

        self._participants = BuiltinDataReader(participant(domain), BuiltinTopicDcpsParticipant)
        message_fields(topic.kind)  # raises an error for an unknown type
        self._kind = topic.kind
        qos = _qos(topic.is_reliable, topic.is_latched, depth)
        self._reader = DataReader(participant(domain), _topic(domain, topic.name, topic.kind), qos=qos)
        self._waiting = WaitSet(participant(domain))
        self._waiting.attach(ReadCondition(self._reader, ViewState.Any | SampleState.NotRead | InstanceState.Any))

    def messages(self, wait_s: float) -> list[Any]:
        """Messages since the last call, the newest last; waits up to a timeout [s] if there are none.

        Raises:
            InputError: if a message does not match the type of its topic.
        """
        return [message for _, message in self.receive(wait_s)]

    def receive(self, wait_s: float) -> list[tuple[int, Any]]:
        """Messages since the last call, each with the handle of its publisher."""
        taken = self._take()
        if not taken and wait_s > 0:
            self._waiting.wait(int(wait_s * 1000) * _NS_PER_MS)
            taken = self._take()
        return [(each.sample_info.publication_handle, decode(self._kind, each)) for each in taken]

    def publishers(self) -> dict[int, str]:
        """Current publishers of the topic, by handle: process and computer, or the GUID."""
        publishers: dict[int, str] = {}
        for handle in self._reader.get_matched_publications():
            endpoint = self._reader.get_matched_publication_data(handle)
            if endpoint is not None:
                publishers[handle % _HANDLE_COUNT] = _publisher_process(self._participants, endpoint)
        return publishers

    def _take(self) -> list[Any]:
        return [each for each in self._reader.take(_MOST_MESSAGES) if isinstance(each, _Bytes)]


def _publisher_process(participants: Any, endpoint: Any) -> str:
    """Process and computer of a publisher that uses CycloneDDS; the GUID of any other publisher."""
    for each in participants.read(_MOST_MESSAGES):
        if each.key == endpoint.participant_key:
            properties = {policy.key: policy.value for policy in each.qos if hasattr(policy, "key")}
            if "__Pid" in properties:
                name, host = properties.get("__ProcessName", "process"), properties.get("__Hostname", "a computer")
                return f"{name} {properties['__Pid']} on {host}"
    return f"GUID {endpoint.key}"


class Publisher:
    """Publisher of a topic."""

    def __init__(self, domain: int, name: str, kind: str, *, is_latched: bool, depth: int = 1) -> None:
        from cyclonedds.core import Policy, Qos
        from cyclonedds.pub import DataWriter

        self._kind = kind
        user_data = Policy.Userdata(f"{_HASH_KEY}{type_hash(kind)};".encode())
        self._topic = _topic(domain, name, kind)
        self._writer = DataWriter(participant(domain), self._topic, qos=_qos(True, is_latched, depth) + Qos(user_data))

    def send(self, message: Any) -> None:
        """Send a message whose attributes are its fields."""
        self.send_bytes(encode(self._kind, message))

    def send_bytes(self, data: bytes) -> None:
        """Send a serialised message."""
        self._writer.write(self._topic.data_type.of(data))


def _qos(is_reliable: bool, is_latched: bool, depth: int) -> Any:
    from cyclonedds.core import Policy, Qos
    from cyclonedds.util import duration

    reliability = Policy.Reliability.Reliable(duration(seconds=1)) if is_reliable else Policy.Reliability.BestEffort
    return Qos(
        reliability,
        Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
    )


@cache
def _topic(domain: int, name: str, kind: str) -> Any:
    from cyclonedds.topic import Topic

    return Topic(participant(domain), _TOPIC_PREFIX + name.removeprefix("/"), _bytes_type(kind))


class _Bytes(bytes):
    """A serialised message; cyclonedds adds attributes with its metadata."""


@cache
def _bytes_type(kind: str) -> Any:
    """A type of cyclonedds with the name and the structure of a message, whose values are serialised bytes.

    The deserialisation of cyclonedds would create a Python integer for every pixel.
    """
    struct = _struct(kind, {})

    def wrap(data: bytes) -> Any:
        """A value that cyclonedds sends as the given bytes."""
        sample = struct.__new__(struct)
        sample.serialize = lambda **_: data
        return sample

    struct.deserialize = staticmethod(_Bytes)
    struct.of = staticmethod(wrap)
    return struct


def _struct(name: str, structs: dict[str, Any]) -> Any:
    from cyclonedds.idl import make_idl_struct

    if name not in structs:
        kinds: Mapping[str, Any] = {key: _annotation(kind, structs) for key, kind in message_fields(name)}
        structs[name] = make_idl_struct(name.rpartition("/")[2], dds_name(name), dict(kinds))
    return structs[name]


def _annotation(kind: Any, structs: dict[str, Any]) -> Any:
    from rosbags.interfaces import Nodetype

    types: Any = import_module("cyclonedds.idl.types")
    node, (content, bound) = kind if kind[0] != Nodetype.NAME else (kind[0], (kind[1], 0))
    if node == Nodetype.NAME:
        return _struct(content, structs)
    if node == Nodetype.BASE:
        plain = {"bool": bool, "string": types.bounded_str[bound] if bound else str}
        plain |= dict.fromkeys(("char", "byte", "octet"), types.uint8)
        return plain[content] if content in plain else getattr(types, content)
    inner = _annotation(content, structs)
    if node == Nodetype.ARRAY:
        return types.array[inner, bound]
    return types.sequence[inner, bound] if bound else types.sequence[inner]
