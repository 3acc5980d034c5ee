"""Waiting until arms and image are still, according to states and pixels."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from basecal.acquisition.driver import Camera, CameraImage, Reading, Robot, check_reading, has_arrived
from basecal.acquisition.freshness import Patience
from basecal.cell import RobotState
from basecal.cell.target import Target
from basecal.geometry import Array
from basecal.vision.detectors import LED, find_target
from basecal.vision.image_motion import Levels, reduce_image, shift_between

_WINDOW_STATES = 12  # number of compared states: a tenth of a second of most controllers
_STILL_RAD_M = 1e-4  # tolerance between the means of both halves of the window: 0.1 mm at a metre
_NOISE_SIGMAS = 4.0  # tolerance in sigmas of that difference, for noisy states
_HAND_GUIDED_RAD_M = 2e-3  # least motion of an arm that a person leads
_STILL_PX = 0.1  # largest motion between still images
_STILL_IMAGES = 3  # still images in a row: two images of a swing may coincide


Note = Callable[[str, Reading], None]
"""Function that receives a robot's name and its newest state."""

Show = Callable[[CameraImage], None]
"""Function that receives each image."""


class Unfit(Exception):
    """A sample is not usable; the text is reported to the user."""


class Moving(Unfit):
    """A sample is not usable because something moved; another attempt may succeed."""


def wait_for_arms(
    robots: Mapping[str, Robot],
    goals: Mapping[str, RobotState],
    patience_s: float,
    note: Note = lambda name, reading: None,
) -> dict[str, Reading]:
    """Wait until all arms are still; the mean of the last states of each arm, by name.

    Args:
        robots: Robots by name; of a robot that is not live, one state is read and used without a check.
        goals: Goals by name; an arm without a goal may be anywhere.
        patience_s: Timeout [s], by the states' timestamps; by this machine's clock while these do not advance.
        note: Receives each state.

    Raises:
        Moving: if an arm is still moving at the timeout, or is not at its goal.
    """
    latest: dict[str, deque[Reading]] = {name: deque(maxlen=_WINDOW_STATES) for name in robots}
    patience = Patience(patience_s)
    while True:
        for name, robot in robots.items():
            if robot.is_live or not latest[name]:
                reading = robot.state()
                check_reading(name, reading)
                latest[name].append(reading)
                note(name, reading)
        live = [name for name, robot in robots.items() if robot.is_live]
        moving = [name for name in live if not _is_still(latest[name], goals.get(name))]
        if not moving:
            return {name: _mean(readings) for name, readings in latest.items()}
        if patience.is_over(latest[live[0]][-1].stamp_s):
            stuck = [name for name in moving if _is_still(latest[name], None)]
            problem = "arm not at its goal" if stuck else "arm still moving"
            raise Moving(f"{problem}: {', '.join(stuck or moving)}{patience.cause}")


def wait_until_hand_guided(
    robots: Mapping[str, Robot],
    states: Mapping[str, RobotState],
    patience_s: float,
    note: Note = lambda name, reading: None,
) -> None:
    """Wait until every arm that is led by hand is still at a new place.

    Args:
        robots: Hand-guided robots, by name.
        states: Previous states, by name; for an arm without one, every place is new.
        patience_s: Timeout [s], by the states' timestamps; by this machine's clock while these do not advance.
        note: Receives each state.

    Raises:
        Moving: if an arm is still moving at the timeout, or was not moved.
    """
    patience = Patience(patience_s)
    while True:
        readings = wait_for_arms(robots, {}, patience_s, note)
        known = [name for name in robots if name in states]
        distances = [np.abs(readings[name].state.vector - states[name].vector).max() for name in known]
        if all(distance > _HAND_GUIDED_RAD_M for distance in distances):
            return
        if patience.is_over(next(iter(readings.values())).stamp_s):
            raise Moving(f"arm not led to another place: {', '.join(robots)}")


def _is_still(readings: Sequence[Reading], goal: RobotState | None) -> bool:
    if len(readings) < _WINDOW_STATES:
        return False
    values = np.stack([reading.state.vector for reading in readings])
    half = _WINDOW_STATES // 2
    change = np.abs(values[half:].mean(0) - values[:half].mean(0))
    sigma = np.diff(values, axis=0).std(0) / np.sqrt(2)
    if np.any(change > np.maximum(_STILL_RAD_M, _NOISE_SIGMAS * sigma * np.sqrt(2 / half))):
        return False
    return goal is None or has_arrived(_mean(readings).state, goal)


def _mean(readings: Sequence[Reading]) -> Reading:
    last = readings[-1]
    return Reading(last.stamp_s, last.state.with_vector(np.stack([each.state.vector for each in readings]).mean(0)))


def wait_for_image_after(
    camera: Camera, after_s: float, patience_s: float, show: Show = lambda image: None
) -> CameraImage:
    """The next image that was exposed after a given time.

    Args:
        camera: The camera.
        after_s: The time [s], by `time.monotonic()`; an image without a known time of exposure is accepted.
        patience_s: Timeout [s].
        show: Receives each image.

    Raises:
        Moving: if all images before the timeout are older.
    """
    deadline_s = time.monotonic() + patience_s
    while True:
        image = camera.image()
        show(image)
        if image.exposed_s is None or image.exposed_s > after_s:
            return image
        if time.monotonic() > deadline_s:
            raise Moving("image too old: all were taken before the arms came to rest; check the camera's clock")


def wait_for_image(
    camera: Camera,
    targets: Sequence[Target],
    patience_s: float,
    after_s: float = -np.inf,
    show: Show = lambda image: None,
) -> CameraImage:
    """The last of three consecutive images without motion; for a camera that is not live, the next image.

    Args:
        camera: The camera.
        targets: Targets in view; an LED covers few pixels and is tracked separately.
        patience_s: Timeout [s], by the images' timestamps; by this machine's clock while these do not advance.
        after_s: Time after which all three images are exposed [s], by `time.monotonic()`.
        show: Receives each image.

    Raises:
        Moving: if something still moves at the timeout, or all images are older.
    """

    def look() -> _Look:
        """The next image, with the detected LEDs."""
        image = wait_for_image_after(camera, after_s, patience_s, show)
        found = [find_target(image.grey, target) for target in targets if target.found_by == LED]
        leds = tuple(None if each is None else each.pixels[0] for each in found)
        return _Look(image, reduce_image(image.grey), leds)

    looks = [look()]
    if not camera.is_live:
        return looks[0].image
    patience, still_count = Patience(patience_s), 0
    patience.is_over(looks[0].image.stamp_s)  # it begins with the first image
    while still_count < _STILL_IMAGES - 1:
        looks = [*looks[1 - _STILL_IMAGES :], look()]
        moves = any(_has_moved(before, looks[-1]) for before in looks[:-1])
        still_count = 0 if moves else still_count + 1
        if patience.is_over(looks[-1].image.stamp_s) and moves:
            raise Moving("image still moving: something shakes, or somebody walks through the image")
    return looks[-1].image


@dataclass(frozen=True, eq=False)
class _Look:
    """An image, its reduced copy, and the positions of its LEDs, (2,) each [px]; None for an LED not found."""

    image: CameraImage
    small: Levels
    leds: tuple[Array | None, ...]


def _has_moved(first: _Look, second: _Look) -> bool:
    for led, other_led in zip(first.leds, second.leds, strict=True):
        if led is not None and other_led is not None and np.linalg.norm(other_led - led) > _STILL_PX:
            return True
    return shift_between(first.small, second.small) > _STILL_PX
