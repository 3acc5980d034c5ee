"""Robots and cameras of a running ROS 2 system, over DDS, without an installation of ROS.

A robot's state is read from joint states, poses, or two tf frames; a camera's images are raw or compressed. Robots are
only read: their own drivers move them.
"""

from __future__ import annotations

import time
from typing import Annotated

from pydantic import Field

from basecal.acquisition.driver import CameraImage, Place, Reading, check_reading, checked_options
from basecal.acquisition.freshness import Waits
from basecal.acquisition.ros2.dds import LAST_DOMAIN, choose_domain, describe_domain
from basecal.acquisition.ros2.states import StatesByFrames, StatesByTopic
from basecal.acquisition.ros2.stream import Stream, stamp_s
from basecal.errors import BasecalError, DriverError
from basecal.exchange.bags.bag import COMPRESSED, IMAGE, Message, Topic
from basecal.exchange.bags.images import image_file
from basecal.fields.values import Entry
from basecal.vision.image_file import grey_image

_QUEUE_SIZE = 1  # queued images
_TIMEOUT_MARGIN_S = 3.0  # in addition to `reconnect_s`, so that the driver's error comes before the feed's timeout

Name = Annotated[str, Field(min_length=1)]


class Ros2Options(Entry):
    """Options of `kind: ros2`.

    Attributes:
        topic: Topic of a robot's joint states or poses, or of a camera's images.
        frames: Base and flange frame of a robot in tf, instead of a topic.
        domain: DDS domain ID; by default the value of ROS_DOMAIN_ID, else 0.
        reconnect_s: Timeout for a topic to appear, and for messages to resume [s].
    """

    topic: Annotated[str, Field(pattern=r"^/[^\s]+$")] | None = None
    frames: Annotated[list[Name], Field(min_length=2, max_length=2)] | None = None
    domain: Annotated[int, Field(ge=0, le=LAST_DOMAIN)] | None = None
    reconnect_s: Annotated[float, Field(ge=0, le=3600)] = 10.0


class Ros2Robot:
    """A robot whose state is published in ROS 2."""

    is_live = True

    def __init__(self, name: str, states: StatesByTopic | StatesByFrames) -> None:
        self._name, self._states, self._waits = name, states, Waits(name)

    def state(self) -> Reading:
        """Return the robot's next state, with the timestamp of its ROS driver [s].

        Raises:
            DriverError: if no state arrives before the timeout, or the rate is too low.
        """
        began_s = time.monotonic()
        reading = self._states.next()
        self._waits.add(time.monotonic() - began_s)
        check_reading(self._name, reading)
        return reading

    def close(self) -> None:
        """Do nothing: the DDS participant is shared by all drivers of this process."""


class Ros2Camera:
    """A camera whose images are published in ROS 2; `wait_s` is the timeout of the driver [s]."""

    is_live = True
    is_stamped = True

    def __init__(self, name: str, stream: Stream, topic: str, size_px: tuple[int, int] | None, wait_s: float) -> None:
        self._name, self._stream, self._topic, self._size_px = name, stream, topic, size_px
        self.wait_s = wait_s
        self._last_s = float("-inf")

    def image(self) -> CameraImage:
        """Return the camera's next image, with the timestamp of its ROS driver [s].

        Raises:
            DriverError: if no image arrives before the timeout, or its encoding or size is not supported.
        """
        last_s = max(self._last_s, 0.0)
        message = self._stream.newest(
            lambda message: message if stamp_s(message.header) > last_s else None, lambda message: True
        )
        now_s = stamp_s(message.header)
        self._last_s = now_s
        try:
            file = image_file(Message(Topic(self._topic, self._stream.kind, 0), now_s, message), self._name)
        except BasecalError as error:
            raise DriverError(str(error)) from None
        grey = grey_image(file.content, self._size_px)
        if isinstance(grey, str):
            raise DriverError(f"{self._name}: an image of {self._topic} {grey}")
        return CameraImage(now_s, grey)

    def close(self) -> None:
        """Do nothing: the DDS participant is shared by all drivers of this process."""


def reaches(place: Place) -> str:
    """Description of the DDS domain.

    Raises:
        DatasetError: if an option is wrong.
        InputError: if ROS_DOMAIN_ID is not a valid domain ID.
    """
    return describe_domain(choose_domain(checked_options(place, Ros2Options).domain))


def open_robot(place: Place) -> Ros2Robot:
    """Open a robot from its topic, or from its tf frames.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if the topic is not published.
        MissingExtra: if cyclonedds or rosbags is not installed.
    """
    options = checked_options(place, Ros2Options)
    domain = choose_domain(options.domain)
    if options.frames is not None:
        if options.topic is not None:
            raise place.error("topic and frames are both stated; expected one of them")
        base, flange = options.frames
        return Ros2Robot(place.name, StatesByFrames(place.name, domain, base, flange, options.reconnect_s))
    chain = place.cell.robots[place.name].chain
    joints = () if chain is None else chain.joint_names
    if chain is None and options.topic is None:
        message = "joint states need urdf, base_link and flange_link; or state `frames: [BASE, FLANGE]`"
        raise place.error(message)
    topic = options.topic or "/joint_states"
    return Ros2Robot(place.name, StatesByTopic(place.name, domain, topic, joints, options.reconnect_s))


def open_camera(place: Place) -> Ros2Camera:
    """Open a camera from the topic of its images.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if the topic is not published.
        MissingExtra: if cyclonedds or rosbags is not installed.
    """
    options = checked_options(place, Ros2Options)
    if options.topic is None or options.frames is not None:
        raise place.error("expected the topic of its images, as `topic: /camera/image_raw`")
    domain = choose_domain(options.domain)
    stream = Stream(place.name, domain, options.topic, (IMAGE, COMPRESSED), _QUEUE_SIZE, options.reconnect_s)
    size_px = place.cell.cameras[place.name].size_px
    return Ros2Camera(place.name, stream, options.topic, size_px, options.reconnect_s + _TIMEOUT_MARGIN_S)
