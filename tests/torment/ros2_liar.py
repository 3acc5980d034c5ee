"""A publisher of ROS 2 that lies, in a process of its own."""

from __future__ import annotations

import os
import socket
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from random import Random
from types import SimpleNamespace as Message
from typing import Any

from cyclonedds.core import DDSException

from basecal.acquisition.ros2.dds import Publisher as TopicPublisher
from basecal.acquisition.ros2.types import encode
from shared.ros2_publisher import Publisher, header, image, joint_state, transform
from torment.damage import torn_bytes

_PERIOD_S = 0.01
_PORT_OF_DOMAIN_0, _PORTS_OF_A_DOMAIN = 7400, 250  # of DDS over UDP
_FAULTS = ("sound", "silent", "torn", "lengths", "numbers", "old", "huge", "dies", "noise", "two")


def _pose(stamp_ns: int) -> Any:
    point = Message(position=Message(x=0.1, y=0.2, z=0.3), orientation=Message(x=0.0, y=0.0, z=0.0, w=1.0))
    return Message(header=header(stamp_ns, "base_link"), pose=point)


def _frames(stamp_ns: int) -> Any:
    return Message(transforms=[transform(stamp_ns, "base_link", "tool0", 0.1)])


def _topics(publisher: Publisher) -> dict[tuple[str, str], Callable[[int], Any]]:
    return {
        ("/joint_states", "sensor_msgs/msg/JointState"): joint_state,
        ("/pose", "geometry_msgs/msg/PoseStamped"): _pose,
        ("/tf", "tf2_msgs/msg/TFMessage"): _frames,
        ("/wrist/image_raw", "sensor_msgs/msg/Image"): lambda ns: image(ns, 64, 48, publisher.ground),
    }


def _change(data: bytes, fault: str, chance: Random) -> bytes:
    at = 4 + 4 * chance.randrange(max(1, (len(data) - 4) // 4))
    if fault == "torn":
        return torn_bytes(data, chance)
    if fault == "lengths":
        return data[:at] + struct.pack("<I", chance.choice([0, 2**31 - 1, 2**32 - 1, 2**24])) + data[at + 4 :]
    if fault == "numbers":
        return data[:at] + struct.pack("<d", chance.choice([float("nan"), 1e308, -1.0, 0.0])) + data[at + 8 :]
    return data + bytes(chance.choice([1, 10**6])) if fault == "huge" else data


def main(domain: int, seed: int, tell: Callable[[str], object]) -> None:
    """Tell that it begins, and send until the process is ended, from a moment on with a fault."""
    chance = Random(seed)
    fault, until_s = chance.choice(_FAULTS), time.monotonic() + chance.choice([0.0, 1.0, 4.0])
    publisher = Publisher(domain, 0.0, 0.0, 64, 48)
    messages = _topics(publisher)
    speakers = {
        topic: [TopicPublisher(domain, *topic, is_latched=False) for _ in range(1 + (fault == "two"))]
        for topic in messages
    }
    noise = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    tell("ready")
    began_ns = time.time_ns()
    while os.getppid() != 1:
        lies = time.monotonic() > until_s
        if lies and fault == "dies":
            os._exit(1)
        for topic, make in messages.items():
            stamp_ns = began_ns if lies and fault == "old" else time.time_ns()
            data = encode(topic[1], make(stamp_ns))
            for speaker in speakers[topic] if not (lies and fault == "silent") else ():
                with suppress(DDSException):  # some bytes are refused before they are sent
                    speaker.send_bytes(_change(data, fault, chance) if lies else data)
        if lies and fault == "noise":
            port = _PORT_OF_DOMAIN_0 + _PORTS_OF_A_DOMAIN * domain + chance.randrange(20)
            noise.sendto(b"RTPS" + chance.randbytes(chance.choice([16, 200, 1400])), ("127.0.0.1", port))
        time.sleep(_PERIOD_S)
