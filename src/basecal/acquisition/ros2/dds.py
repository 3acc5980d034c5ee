"""Topics of ROS 2 over DDS, by cyclonedds: which there are, what comes on them, and what is sent.

ROS 2 writes the topic `/joint_states` as `rt/joint_states`, its type as `sensor_msgs::msg::dds_::JointState_`, and the
hash of the type into the sender's user data. A reader asks for the reliability and the durability that is
offered, so that whatever a driver chose, the two agree.
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

_TOPIC = "rt/"  # before the name of each topic of ROS 2
_HASH = "typehash="
LAST_DOMAIN = 232
"""The last number of a domain: ports of DDS beyond it would be beyond 65535."""
_MS = 1_000_000  # [ns]
_LOOK_S = 0.05  # between looks at what was discovered
_AT_MOST = 2000  # messages taken at once
_NUMBERS = 2**64  # of publishers, which one of two functions of cyclonedds gives with a sign


@dataclass(frozen=True)
class Offer:
    """A topic that somebody sends.

    Attributes:
        name: As ROS 2 has it: `/joint_states`.
        kind: The type of its messages: `sensor_msgs/msg/JointState`.
        is_reliable: Whether everybody who sends it sends again what was lost.
        is_latched: Whether everybody who sends it gives the last messages to those who come later.
        type_hash: Of the type, as it is sent; empty before ROS 2 Iron.
    """

    name: str
    kind: str
    is_reliable: bool
    is_latched: bool
    type_hash: str


@cache
def participant(domain: int) -> Any:
    """The participant of this process in a domain.

    Raises:
        MissingExtra: if cyclonedds is not installed.
        InputError: if DDS finds no network that it may use.
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
    """The domain that is stated, else that of the variable ROS_DOMAIN_ID, else 0.

    Raises:
        InputError: if the variable is no number of a domain.
    """
    if domain is not None:
        return domain
    said = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not (said.isdecimal() and int(said) <= LAST_DOMAIN):
        raise InputError(f"ROS_DOMAIN_ID is {said!r}: expected a number from 0 to {LAST_DOMAIN}")
    return int(said)


def domain_words(domain: int) -> str:
    """Description of the computers that a domain reaches."""
    return f"ROS 2 in domain {domain}, by DDS on all networks of this computer"


class Discovery:
    """The topics that are sent in a domain."""

    def __init__(self, domain: int) -> None:
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication

        self._reader = BuiltinDataReader(participant(domain), BuiltinTopicDcpsPublication)

    def offers(self) -> dict[str, Offer]:
        """Topics by name."""
        found: dict[str, Offer] = {}
        for endpoint in self._reader.read(_AT_MOST):
            offer = _offer(endpoint)
            before = None if offer is None else found.get(offer.name)
            if offer is not None and before is not None:
                offer = Offer(
                    offer.name,
                    offer.kind,
                    offer.is_reliable and before.is_reliable,
                    offer.is_latched and before.is_latched,
                    offer.type_hash or before.type_hash,
                )
            if offer is not None:
                found[offer.name] = offer
        return found

    def wait_for(self, name: str, wait_s: float) -> Offer | None:
        """The topic, once it is there; None if it never is [s]."""
        until = time.monotonic() + wait_s
        while (offer := self.offers().get(name)) is None and time.monotonic() < until:
            time.sleep(_LOOK_S)
        return offer


def _offer(endpoint: Any) -> Offer | None:
    from cyclonedds.core import Policy

    kind = kind_of_dds(endpoint.type_name or "")
    if kind is None or not endpoint.topic_name.startswith(_TOPIC) or not endpoint.sample_info.valid_data:
        return None
    qos = endpoint.qos
    said = bytes(qos[Policy.Userdata].data).decode(errors="replace") if Policy.Userdata in qos else ""
    hashes = [part.removeprefix(_HASH) for part in said.split(";") if part.startswith(_HASH)]
    return Offer(
        "/" + endpoint.topic_name.removeprefix(_TOPIC),
        kind,
        isinstance(qos[Policy.Reliability], Policy.Reliability.Reliable) if Policy.Reliability in qos else False,
        Policy.Durability in qos and qos[Policy.Durability] == Policy.Durability.TransientLocal,
        (hashes or [""])[0],
    )


class Listener:
    """The messages on a topic, whole, the newest last."""

    def __init__(self, domain: int, offer: Offer, depth: int) -> None:
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsParticipant
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
        from cyclonedds.sub import DataReader

        self._participants = BuiltinDataReader(participant(domain), BuiltinTopicDcpsParticipant)
        message_fields(offer.kind)  # an error if nobody knows it
        self._kind = offer.kind
        qos = _qos(offer.is_reliable, offer.is_latched, depth)
        self._reader = DataReader(participant(domain), _topic(domain, offer.name, offer.kind), qos=qos)
        self._waiting = WaitSet(participant(domain))
        self._waiting.attach(ReadCondition(self._reader, ViewState.Any | SampleState.NotRead | InstanceState.Any))

    def messages(self, wait_s: float) -> list[Any]:
        """Messages since the last call; waits for one if there are none.

        Raises:
            InputError: if one is not what its topic says.
        """
        return [message for _, message in self.receive(wait_s)]

    def receive(self, wait_s: float) -> list[tuple[int, Any]]:
        """Messages since the last call, each with the number of its publisher."""
        taken = self._take()
        if not taken and wait_s > 0:
            self._waiting.wait(int(wait_s * 1000) * _MS)
            taken = self._take()
        return [(each.sample_info.publication_handle, decode(self._kind, each)) for each in taken]

    def publishers(self) -> dict[int, str]:
        """Publishers of the topic now by their numbers: the process and computer of each, or its GUID."""
        found: dict[int, str] = {}
        for number in self._reader.get_matched_publications():
            endpoint = self._reader.get_matched_publication_data(number)
            if endpoint is not None:
                found[number % _NUMBERS] = _publisher_process(self._participants, endpoint)
        return found

    def _take(self) -> list[Any]:
        return [each for each in self._reader.take(_AT_MOST) if isinstance(each, _Bytes)]


def _publisher_process(participants: Any, endpoint: Any) -> str:
    """The process of a publisher, as CycloneDDS states its own; its GUID if it is of another DDS."""
    for each in participants.read(_AT_MOST):
        if each.key == endpoint.participant_key:
            said = {policy.key: policy.value for policy in each.qos if hasattr(policy, "key")}
            if "__Pid" in said:
                return (
                    f"{said.get('__ProcessName', 'process')} {said['__Pid']} on {said.get('__Hostname', 'a computer')}"
                )
    return f"GUID {endpoint.key}"


class Speaker:
    """A writer of messages of this process on a topic."""

    def __init__(self, domain: int, name: str, kind: str, *, is_latched: bool, depth: int = 1) -> None:
        from cyclonedds.core import Policy, Qos
        from cyclonedds.pub import DataWriter

        self._kind = kind
        said = Policy.Userdata(f"{_HASH}{type_hash(kind)};".encode())
        self._topic = _topic(domain, name, kind)
        self._writer = DataWriter(participant(domain), self._topic, qos=_qos(True, is_latched, depth) + Qos(said))

    def send(self, message: Any) -> None:
        """Send a message, its fields being attributes."""
        self.send_bytes(encode(self._kind, message))

    def send_bytes(self, data: bytes) -> None:
        """Send a message that is serialised already."""
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

    return Topic(participant(domain), _TOPIC + name.removeprefix("/"), _bytes_type(kind))


class _Bytes(bytes):
    """A message as it came; cyclonedds hangs what it knows of it on it."""


@cache
def _bytes_type(kind: str) -> Any:
    """A type of cyclonedds that has the name and the structure of a message, but whose values are its bytes.

    It would make a Python integer of every pixel.
    """
    made = _struct(kind, {})

    def wrap(data: bytes) -> Any:
        """A value that cyclonedds sends as these bytes."""
        sample = made.__new__(made)
        sample.serialize = lambda **_: data
        return sample

    made.deserialize = staticmethod(_Bytes)
    made.of = staticmethod(wrap)
    return made


def _struct(name: str, structs: dict[str, Any]) -> Any:
    from cyclonedds.idl import make_idl_struct

    if name not in structs:
        kinds: Mapping[str, Any] = {key: _annotation(kind, structs) for key, kind in message_fields(name)}
        structs[name] = make_idl_struct(name.rpartition("/")[2], dds_name(name), dict(kinds))
    return structs[name]


def _annotation(kind: Any, structs: dict[str, Any]) -> Any:
    from rosbags.interfaces import Nodetype

    types: Any = import_module("cyclonedds.idl.types")
    node, (within, most) = kind if kind[0] != Nodetype.NAME else (kind[0], (kind[1], 0))
    if node == Nodetype.NAME:
        return _struct(within, structs)
    if node == Nodetype.BASE:
        plain = {"bool": bool, "string": types.bounded_str[most] if most else str}
        plain |= dict.fromkeys(("char", "byte", "octet"), types.uint8)
        return plain[within] if within in plain else getattr(types, within)
    inner = _annotation(within, structs)
    if node == Nodetype.ARRAY:
        return types.array[inner, most]
    return types.sequence[inner, most] if most else types.sequence[inner]
