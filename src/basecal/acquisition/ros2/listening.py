"""Messages of a ROS 2 domain, recorded for a while as a bag is: a cell is made of them likewise."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

from basecal.acquisition.ros2.dds import Discovery, Listener, Offer
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
}  # messages heard at once
_KEPT_MESSAGES = 500  # messages of a topic: frames of tf come from several nodes
_POLL_S = 0.02


def listen_to_topics(domain: int, listen_s: float) -> Bag:
    """Messages on all topics of a domain that concern robots and cameras, one image of each.

    Raises:
        DriverError: if nobody sends any.
    """
    discovery, listeners = Discovery(domain), dict[str, tuple[Offer, Listener]]()
    messages: dict[str, list[Any]] = {}
    counts: dict[str, int] = {}
    until = time.monotonic() + listen_s
    while time.monotonic() < until:
        for name, offer in discovery.offers().items():
            if offer.kind in _QUEUE_DEPTHS and name not in listeners:
                listeners[name] = offer, Listener(domain, offer, _QUEUE_DEPTHS[offer.kind])
        for name, (offer, listener) in listeners.items():
            came = listener.messages(0.0)
            most = _KEPT_MESSAGES if _QUEUE_DEPTHS[offer.kind] > 1 else 1
            counts[name] = counts.get(name, 0) + len(came)
            messages[name] = [*messages.get(name, []), *came][:most]
        time.sleep(_POLL_S)
    if not listeners:
        raise DriverError(
            f"nobody sends joint states, tf or images in domain {domain}. Is ROS_DOMAIN_ID the same there, and does "
            "the network let DDS pass?"
        )
    topics = {name: Topic(name, offer.kind, counts[name]) for name, (offer, _) in listeners.items()}

    def read(names: Iterable[str]) -> Iterator[Message]:
        """Recorded messages of some topics, one topic after another."""
        for name in names:
            yield from (Message(topics[name], 0.0, data) for data in messages.get(name, []))

    return Bag(f"ROS 2 in domain {domain}", topics, read)


def survey_live_topics(bag: Bag) -> Survey:
    """Survey of the recorded messages; every frame of /tf counts as moving, though the arms may have stood still."""
    survey = survey_bag(bag)
    hangs = {name: hang._replace(is_fixed=not hang.is_timed) for name, hang in survey.tree.hangs.items()}
    return replace(survey, tree=Tree(hangs))
