"""Publication of calibrated transforms on `/tf_static`, in the same way as `static_transform_publisher` of ROS 2."""

from __future__ import annotations

import time
from collections.abc import Iterable
from types import SimpleNamespace as Message

from basecal.acquisition.ros2.dds import Publisher
from basecal.exchange.bags.bag import TF
from basecal.geometry import SE3

STATIC_TOPIC = "/tf_static"
_NS_PER_S = 10**9


def send_static(domain: int, transforms: Iterable[tuple[str, str, SE3]]) -> Publisher:
    """Publish static transforms; later subscribers receive them as long as the returned publisher exists.

    Args:
        domain: DDS domain ID.
        transforms: Name of the parent frame, name of the child frame, and `parent_from_child`.
    """
    publisher = Publisher(domain, STATIC_TOPIC, TF, is_latched=True)
    now_ns = time.time_ns()
    stamp = Message(sec=now_ns // _NS_PER_S, nanosec=now_ns % _NS_PER_S)
    messages = []
    for parent, child, parent_from_child in transforms:
        translation = Message(**dict(zip("xyz", map(float, parent_from_child.translation), strict=True)))
        rotation = Message(**dict(zip("xyzw", map(float, parent_from_child.quaternion), strict=True)))
        header, transform = Message(stamp=stamp, frame_id=parent), Message(translation=translation, rotation=rotation)
        messages.append(Message(header=header, child_frame_id=child, transform=transform))
    publisher.send(Message(transforms=messages))
    return publisher
