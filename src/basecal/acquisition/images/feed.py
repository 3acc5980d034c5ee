"""Live cameras, each read continuously by a thread: the newest image, with an estimate of its time of exposure."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from basecal.acquisition.driver import Camera, CameraImage, Switches, driver_errors
from basecal.acquisition.images.latency import ArmMotion, Latency, estimate_latency
from basecal.errors import DriverError
from basecal.geometry import Array
from basecal.vision.image_motion import Levels, reduce_image, shift_between

_IMAGE_TIMEOUT_S = 10.0  # for an image, unless the driver defines `wait_s`
_CLOSE_TIMEOUT_S = 2.0  # for the thread to end: a call of the driver may hang
_UNKNOWN_S, _UNKNOWN_IMAGES = 2.0, 12  # assumed latency until it is measured, whichever is longer
_MOTION_COUNT = 3  # last motions whose latencies count: the latency may vary
_MOVES_PX = 0.1  # smallest motion between consecutive images, reduced to about 640 px
_IMAGE_COLUMNS = 640
_UNLIKE, _QUIET, _CHANGES = 3.0, 0.2, 300  # factor on this quantile of the last changes: above it, images differ
_REMEMBERED_IMAGES = 2000  # number of stored arrivals
_STREAM, _STREAM_S = 4, 5.0  # this many images within this time are a stream
_WAITED, _USUAL, _WAITS = 0.5, 0.9, 50  # factor on this quantile of the last waits: below it, an image was buffered
_LATE, _LATE_S = 3, 2.0  # this many older images over this time show that the clock went back
_LOOK_S = 1.5  # time to distinguish a program that saves images continuously from a person


class CameraFeed:
    """A camera that a thread reads continuously."""

    def __init__(self, name: str, camera: Camera, arms: ArmMotion) -> None:
        self._name, self._camera, self._arms = name, camera, arms
        self._changed = threading.Condition()
        self._is_stamped = getattr(camera, "is_stamped", False)
        self._arrivals: deque[tuple[float, bool]] = deque(
            maxlen=_REMEMBERED_IMAGES
        )  # time, and whether something moved since the previous image
        self._delays_s: deque[float] = deque(maxlen=_REMEMBERED_IMAGES)  # arrival less stamp
        self._waits_s: deque[float] = deque(maxlen=_WAITS)
        self._changes: deque[float] = deque(maxlen=_CHANGES)  # mean change of brightness between consecutive images
        self._last_s = -np.inf
        self._late_s: list[float] = []  # arrivals of later images with older timestamps
        self._late_count, self._late_source = 0, ""  # such images that are not reported yet, and the last one
        self._notes: list[str] = []
        self._newest: tuple[CameraImage, float] | None = None
        self._requested_light: bool | None = None  # requested state: only the thread calls the driver
        self._latencies: dict[float, Latency] = {}  # by the start of the motion from which they were measured
        self._reported: Latency | None = None
        self._began_s, self._is_open = time.monotonic(), True
        self._start_thread()

    @property
    def is_live(self) -> bool:
        """Whether images arrive continuously, also as files that a program saves."""
        with self._changed:
            remaining_s = self._began_s + _LOOK_S - time.monotonic()
            if not self._camera.is_live and remaining_s > 0:
                self._changed.wait_for(lambda: len(self._arrivals) >= _STREAM, remaining_s)
            recent = list(self._arrivals)[-_STREAM:]
        return self._camera.is_live or (len(recent) == _STREAM and time.monotonic() - recent[0][0] < _STREAM_S)

    def image(self) -> CameraImage:
        """Wait for the newest image that was not returned yet, with its earliest possible time of exposure.

        Raises:
            DriverError: if the camera fails, or no image arrives before the timeout.
        """
        self._wait(lambda: self._newest is not None)
        with self._changed:
            assert self._newest is not None
            (image, arrived_s), self._newest = self._newest, None
            arrivals = np.array(self._arrivals)
        exposed_s = arrived_s - self._latency_s(arrivals)
        notes, self._notes = [*self._notes, *self._late_notes()], []
        self._late_count = 0
        return replace(image, exposed_s=exposed_s, note="; ".join(notes))

    def _late_notes(self) -> list[str]:
        """A note about the late images that are not reported yet; empty if there are none."""
        if not self._late_count:
            return []
        if self._late_count == 1:
            return [f"camera {self._name}: {self._late_source} came after a newer one; not used"]
        many = f"{self._late_count} images came after newer ones; not used. The last is {self._late_source}"
        return [f"camera {self._name}: {many}"]

    def close(self) -> None:
        """Close the camera; a driver that hangs stays open until the process ends."""
        self._is_open = False
        self._thread.join(_CLOSE_TIMEOUT_S)
        if not self._thread.is_alive():
            self._camera.close()

    def _start_thread(self) -> None:
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._read_images, daemon=True)
        self._thread.start()

    def _wait(self, is_done: Callable[[], bool]) -> None:
        """Wait for the thread; restart it if it ended in the meantime."""
        if not self._thread.is_alive():
            self._start_thread()
        wait_s = getattr(self._camera, "wait_s", _IMAGE_TIMEOUT_S)
        with self._changed:
            if not self._changed.wait_for(lambda: is_done() or self._error is not None, wait_s):
                late = "".join(f". {note}" for note in self._late_notes())
                raise DriverError(f"{self._name}: no image came within {wait_s:g} s; check its cable and program{late}")
            if not is_done() and self._error is not None:
                raise self._error

    def _read_images(self) -> None:
        previous: Levels | None = None
        try:
            while self._is_open:
                with driver_errors(self._name):
                    self._switch_led()
                    began_s = time.monotonic()
                    image = self._camera.image()
                now_s = time.monotonic()
                if self._is_outdated(image, now_s - began_s):
                    continue
                stride = max(1, image.grey.shape[1] // _IMAGE_COLUMNS)
                levels = reduce_image(image.grey[::stride, ::stride])
                self._add(image, previous is not None and self._has_moved(previous, levels), now_s)
                previous = levels
        except Exception as error:  # of any library: raised again in `_wait`
            with self._changed:
                self._error = error
                self._changed.notify_all()

    def _has_moved(self, first: Levels, second: Levels) -> bool:
        if first.shape != second.shape:
            return True
        change = float(np.abs(second - first).mean())
        if change > 0:  # some cameras repeat an image
            self._changes.append(change)
        # Block matching fails if the whole image shifts far.
        is_unlike = change > _UNLIKE * np.quantile(self._changes or [change], _QUIET)
        return bool(is_unlike) or shift_between(first, second) > _MOVES_PX

    def _is_outdated(self, image: CameraImage, waited_s: float) -> bool:
        """Whether an image is older than an earlier one, or arrived without a wait and thus from a buffer.

        Raises:
            DriverError: if all recent images are older.
        """
        self._waits_s.append(waited_s)
        if not self._is_stamped:
            return waited_s < _WAITED * float(np.quantile(self._waits_s, _USUAL))
        is_late, self._last_s = image.stamp_s < self._last_s, max(self._last_s, image.stamp_s)
        if not is_late:
            self._late_s.clear()
            return False
        self._late_s.append(time.monotonic())
        if len(self._late_s) >= _LATE and self._late_s[-1] - self._late_s[0] > _LATE_S:
            raise DriverError(
                f"{self._name}: the last {len(self._late_s)} images are older than the one before them. "
                f"The clock of the camera went back: start the capture again"
            )
        self._late_count, self._late_source = self._late_count + 1, image.source or "an image"
        return True

    def _add(self, image: CameraImage, has_moved: bool, now_s: float) -> None:
        with self._changed:
            self._delays_s.append(now_s - image.stamp_s)
            arrived_s = image.stamp_s + min(self._delays_s) if self._is_stamped else now_s
            self._arrivals.append((arrived_s, has_moved))
            self._newest = image, arrived_s
            self._changed.notify_all()

    def _switch_led(self) -> None:
        with self._changed:
            if self._requested_light is not None and isinstance(self._camera, Switches):
                self._camera.light(self._requested_light)
            self._requested_light = None
            self._changed.notify_all()

    def _latency_s(self, arrivals: Array) -> float:
        """Upper bound of the latency of images [s]."""
        if not self.is_live:
            return 0.0
        spans = self._arms.spans
        measured = estimate_latency(np.array(spans), arrivals[arrivals[:, 0] >= spans[0][0]]) if spans else None
        if measured is not None:
            self._report(measured)
            self._latencies = {**self._latencies, spans[0][0]: measured}
        known_s = max((each.high_s for each in list(self._latencies.values())[-_MOTION_COUNT:]), default=0.0)
        if measured is not None or (self._latencies and not spans):
            return known_s
        interval_s = float(np.median(np.diff(arrivals[:, 0]))) if len(arrivals) > 1 else 0.0
        return max(_UNKNOWN_S, _UNKNOWN_IMAGES * interval_s, known_s)

    def _report(self, latency: Latency) -> None:
        previous = self._reported
        if previous is None or latency.low_s > previous.high_s:
            self._reported = latency
            change = f", {previous} before" if previous else ""
            self._notes.append(f"camera {self._name}: images arrive {latency} after exposure{change} (measured)")


class LightFeed(CameraFeed):
    """The feed of a camera that can switch the LED in its view."""

    def light(self, on: bool) -> None:
        """Switch the LED between two images.

        Raises:
            DriverError: if the camera fails, or no image arrives before the timeout.
        """
        with self._changed:
            self._requested_light = on
        self._wait(lambda: self._requested_light is None)


def feed_camera(name: str, camera: Camera, arms: ArmMotion) -> Camera:
    """Wrap a camera in a feed, unless it exposes images on request.

    Args:
        name: Name of the camera.
        camera: The driver's camera.
        arms: Times at which the arms move.
    """
    if getattr(camera, "is_on_demand", not camera.is_live):
        return camera
    return (LightFeed if isinstance(camera, Switches) else CameraFeed)(name, camera, arms)
