"""Recording of live ROS 2 topics as a bag, from which a cell is created in the same way as from a bag file."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

from basecal.acquisition.ros2.dds import Discovery, PublishedTopic, Subscriber
from basecal.errors import DriverError
from basecal.exchange.bags.bag import CAMERA_INFO, COMPRESSED, IMAGE, JOINTS, POSE, TEXT, TF, Bag, Message, Topic
from basecal.exchange.bags.frames import Tree
from basecal.exchange.bags.survey import Survey, survey_bag

_QUEUE_DEPTHS = {
    TF: 1000,
    JOINTS: 100,
    POSE: 10,
    TEXT: 1,
    IMAGE: 1,
    COMPRESSED: 1,
    CAMERA_INFO: 1,
}  # queued messages of each topic, by type
_KEPT_MESSAGES = 500  # recorded messages of a topic: several nodes send tf frames
_POLL_S = 0.02


def listen_to_topics(domain: int, listen_s: float) -> Bag:
    """Record the topics of robots and cameras in a domain for a duration [s], with one image per image topic.

    Raises:
        DriverError: if there is no such topic.
    """
    discovery, subscribers = Discovery(domain), dict[str, tuple[PublishedTopic, Subscriber]]()
    messages: dict[str, list[Any]] = {}
    counts: dict[str, int] = {}
    deadline_s = time.monotonic() + listen_s
    while time.monotonic() < deadline_s:
        for name, topic in discovery.topics().items():
            if topic.kind in _QUEUE_DEPTHS and name not in subscribers:
                subscribers[name] = topic, Subscriber(domain, topic, _QUEUE_DEPTHS[topic.kind])
        for name, (topic, subscriber) in subscribers.items():
            arrived = subscriber.messages(0.0)
            kept = _KEPT_MESSAGES if _QUEUE_DEPTHS[topic.kind] > 1 else 1
            counts[name] = counts.get(name, 0) + len(arrived)
            messages[name] = [*messages.get(name, []), *arrived][:kept]
        time.sleep(_POLL_S)
    if not subscribers:
        raise DriverError(
            f"no publisher of joint states, tf or images in domain {domain}. Is ROS_DOMAIN_ID the same there, and does "
            "the network let DDS pass?"
        )
    topics = {name: Topic(name, topic.kind, counts[name]) for name, (topic, _) in subscribers.items()}

    def read(names: Iterable[str]) -> Iterator[Message]:
        """Recorded messages of the named topics, one topic after another."""
        for name in names:
            yield from (Message(topics[name], 0.0, data) for data in messages.get(name, []))

    return Bag(f"ROS 2 in domain {domain}", topics, read)


def survey_live_topics(bag: Bag) -> Survey:
    """Survey of the recorded messages; every /tf frame counts as moving, since the arms may have been at rest."""
    survey = survey_bag(bag)
    transforms = survey.tree.transforms.items()
    moving = {name: each._replace(is_fixed=not each.is_timed) for name, each in transforms}
    return replace(survey, tree=Tree(moving))
