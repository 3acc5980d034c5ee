"""Publication of calibrated transforms on `/tf_static`, in the same way as `static_transform_publisher` of ROS 2."""

from __future__ import annotations

import time
from collections.abc import Iterable
from types import SimpleNamespace as Message

from basecal.acquisition.ros2.dds import Speaker
from basecal.exchange.bags.bag import TF
from basecal.geometry import SE3

STATIC_TOPIC = "/tf_static"
_NANOSECONDS = 10**9  # in a second


def send_static(domain: int, transforms: Iterable[tuple[str, str, SE3]]) -> Speaker:
    """Publish static transforms; later subscribers receive them as long as the returned publisher exists.

    Args:
        domain: DDS domain ID.
        transforms: Name of the parent frame, name of the child frame, and `parent_from_child`.
    """
    speaker = Speaker(domain, STATIC_TOPIC, TF, is_latched=True)
    now_ns = time.time_ns()
    stamp = Message(sec=now_ns // _NANOSECONDS, nanosec=now_ns % _NANOSECONDS)
    sent = []
    for parent, child, parent_from_child in transforms:
        place = Message(**dict(zip("xyz", map(float, parent_from_child.translation), strict=True)))
        turn = Message(**dict(zip("xyzw", map(float, parent_from_child.quaternion), strict=True)))
        header, transform = Message(stamp=stamp, frame_id=parent), Message(translation=place, rotation=turn)
        sent.append(Message(header=header, child_frame_id=child, transform=transform))
    speaker.send(Message(transforms=sent))
    return speaker
