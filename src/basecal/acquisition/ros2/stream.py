"""Stream of the messages of a topic, each newer than the previous one by its timestamp."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from basecal.acquisition.freshness import STALE_S
from basecal.acquisition.ros2.dds import Discovery, Subscriber
from basecal.acquisition.ros2.types import type_hash
from basecal.errors import DriverError, count_text, list_names

_NANOSECOND_S = 1e-9  # [s]

Converted = TypeVar("Converted")


def stamp_s(header: Any) -> float:
    """The time of a `std_msgs/Header` [s]."""
    return float(header.stamp.sec + _NANOSECOND_S * header.stamp.nanosec)


class Stream:
    """Stream of a topic in a domain.

    Attributes:
        kind: Type of the messages.
    """

    def __init__(self, name: str, domain: int, topic: str, kinds: Sequence[str], depth: int, wait_s: float) -> None:
        self._name, self._domain, self._topic, self._wait_s = name, domain, topic, wait_s
        self._discovery = Discovery(domain)
        offered = self._discovery.wait_for_topic(topic, wait_s)
        if offered is None:
            known = list_names(sorted(self._discovery.topics()))
            raise DriverError(
                f"{name}: no publisher of {topic} in domain {domain}; there are: {known}. "
                f"Is ROS_DOMAIN_ID the same there, and does the network let DDS pass?"
            )
        if offered.kind not in kinds:
            raise DriverError(f"{name}: {topic} is of {offered.kind}, expected {list_names(list(kinds))}")
        if offered.type_hash and offered.type_hash != type_hash(offered.kind):
            raise DriverError(
                f"{name}: {topic} has another definition of {offered.kind} than ROS 2's releases: {offered.type_hash}"
            )
        self.kind = offered.kind
        self._subscriber = Subscriber(domain, offered, depth)
        self._publishers: set[int] = set()

    def messages(self, wait_s: float = 0.0) -> list[Any]:
        """Messages since the last call, the oldest first; waits up to a timeout [s] if there are none."""
        return self._subscriber.messages(wait_s)

    def newest(
        self, read: Callable[[Any], Converted | None], is_mine: Callable[[Any], bool] | None = None
    ) -> Converted:
        """Wait for a message with a result of `read`; the result of the newest such message.

        Args:
            read: Converts a message, or returns None to skip it; called for every message.
            is_mine: Whether only a single publisher may send a message; None to allow several publishers.

        Raises:
            DriverError: if no usable message arrives before the timeout, or two publishers send such messages.
        """
        deadline_s, message_count = time.monotonic() + STALE_S + self._wait_s, 0
        while True:
            messages = self._subscriber.receive(STALE_S)
            message_count += len(messages)
            if is_mine is not None:
                self._check_publishers({publisher for publisher, message in messages if is_mine(message)})
            results = [result for _, message in messages if (result := read(message)) is not None]
            if results:
                return results[-1]
            if time.monotonic() > deadline_s:
                raise DriverError(f"{self._name}: {self._silence_reason(message_count)}")

    def _check_publishers(self, publishers: set[int]) -> None:
        """Check that there is only one publisher; a publisher that ended and was restarted counts once.

        Raises:
            DriverError: if there are several publishers.
        """
        self._publishers |= publishers
        if len(self._publishers) < 2:
            return
        known = self._subscriber.publishers()
        self._publishers = publishers | (self._publishers & known.keys())
        if len(self._publishers) > 1:
            words = list_names(sorted(known.get(number, f"publisher {number}") for number in self._publishers))
            raise DriverError(
                f"{self._name}: {len(self._publishers)} publishers send {self._topic}: {words}. Their values cannot be "
                f"distinguished. End all but one, or give each robot a topic of its own"
            )

    def _silence_reason(self, message_count: int) -> str:
        waited = f"for {STALE_S + self._wait_s:g} s"
        if message_count:
            return (
                f"stale stamps: {count_text(message_count, 'message')} came on {self._topic} {waited}. None is "
                f"complete and newer than the last one taken. Look at `ros2 topic echo {self._topic}`"
            )
        if self._topic not in self._discovery.topics():
            return f"{self._topic} has no publisher any more: is its node still running, and the network plugged in?"
        return f"no message came on {self._topic} {waited}, although it has a publisher: is its source switched on?"
