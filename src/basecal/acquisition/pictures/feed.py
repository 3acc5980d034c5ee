"""Live cameras, read without pause by a thread each: the newest picture is given, with the time of its exposure."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from basecal.acquisition.driver import Camera, Picture, Switches
from basecal.acquisition.pictures.arm_motion import ArmMotion
from basecal.acquisition.pictures.latency import Latency, latency_of
from basecal.errors import DriverError
from basecal.geometry import Array
from basecal.vision.picture_motion import Levels, shift_between, small

_WAIT_S = 10.0  # for a picture, unless the driver states how long it waits
_CLOSE_S = 2.0  # for a driver that does not come back
_UNKNOWN_S, _UNKNOWN_PICTURES = 2.0, 12  # of latency until it is measured, whichever is longer
_GROWTH = 2.0  # of a latency since it was measured, where a motion is not seen
_MOTIONS = 3  # whose latencies count: it may grow, and shrink again
_MOVES_PX = 0.1  # between a picture and the next, of about 640 px
_COLUMNS = 640
_PICTURES = 2000  # whose arrival is remembered
_STREAM, _STREAM_S = 4, 5.0  # so many pictures within such a time are a stream
_WAITED = 0.5  # of the usual time for a picture: one that came sooner had been waiting in a buffer


class CameraFeed:
    """A camera that is read without pause."""

    def __init__(self, name: str, camera: Camera, arms: ArmMotion) -> None:
        self._name, self._camera, self._arms = name, camera, arms
        self._changed = threading.Condition()
        self._is_stamped = getattr(camera, "is_stamped", False)
        self._arrivals: deque[tuple[float, bool]] = deque(maxlen=_PICTURES)  # and whether something moved since before
        self._delays_s: deque[float] = deque(maxlen=_PICTURES)  # arrival less stamp
        self._waits_s: deque[float] = deque(maxlen=_PICTURES)
        self._last_s = -np.inf
        self._notes: list[str] = []
        self._newest: tuple[Picture, float] | None = None
        self._error: Exception | None = None
        self._light: bool | None = None  # that the thread shall switch: a driver serves one thread
        self._latencies: dict[float, Latency] = {}  # by the begin of the motion they were measured on
        self._reported: Latency | None = None
        self._is_open, self._thread = True, self._started()

    @property
    def is_live(self) -> bool:
        """Whether pictures come one after another, also where each is saved as a file."""
        with self._changed:
            recent = list(self._arrivals)[-_STREAM:]
        return self._camera.is_live or (len(recent) == _STREAM and time.monotonic() - recent[0][0] < _STREAM_S)

    def picture(self) -> Picture:
        """Wait for the newest picture that was not given yet, with the earliest time at which it was exposed.

        Raises:
            DriverError: if the camera gives none any more, or is silent.
        """
        self._go_on()
        with self._changed:
            self._wait(lambda: self._newest is not None)
            assert self._newest is not None
            (picture, seen_s), self._newest = self._newest, None
            arrivals = np.array(self._arrivals)
        exposed_s = seen_s - self._latency_s(arrivals)
        note, self._notes = "; ".join(self._notes), []
        return replace(picture, exposed_s=exposed_s, note=note)

    def close(self) -> None:
        """Let go of the camera; a driver that does not come back is left to the end of the process."""
        self._is_open = False
        self._thread.join(_CLOSE_S)
        if not self._thread.is_alive():
            self._camera.close()

    def _go_on(self) -> None:
        """Read again where that ended while nobody waited."""
        if not self._thread.is_alive():
            self._error, self._thread = None, self._started()

    def _wait(self, done: Callable[[], bool]) -> None:
        wait_s = getattr(self._camera, "wait_s", _WAIT_S)
        came = self._changed.wait_for(lambda: done() or self._error is not None, wait_s)
        if self._error is not None and not done():
            raise self._error
        if not came:
            raise DriverError(f"{self._name}: no picture came within {wait_s:g} s; check its cable and program")

    def _started(self) -> threading.Thread:
        thread = threading.Thread(target=self._drain, name=f"camera {self._name}", daemon=True)
        thread.start()
        return thread

    def _drain(self) -> None:
        before: Levels | None = None
        try:
            while self._is_open:
                self._switch()
                began_s = time.monotonic()
                picture = self._camera.picture()
                now_s = time.monotonic()
                if self._is_late(picture):
                    continue
                every = max(1, picture.grey.shape[1] // _COLUMNS)
                levels = small(picture.grey[::every, ::every])
                moves = before is not None and shift_between(before, levels) > _MOVES_PX
                before = levels
                self._add(picture, moves, now_s, now_s - began_s)
        except Exception as error:  # of whatever library: who waits for a picture is told
            with self._changed:
                self._error = error
                self._changed.notify_all()

    def _is_late(self, picture: Picture) -> bool:
        is_late = self._is_stamped and picture.stamp_s < self._last_s
        if is_late:
            self._notes.append(f"camera {self._name}: {picture.source or 'a picture'} came after a newer one; not used")
        self._last_s = max(self._last_s, picture.stamp_s)
        return is_late

    def _add(self, picture: Picture, moves: bool, now_s: float, waited_s: float) -> None:
        with self._changed:
            self._delays_s.append(now_s - picture.stamp_s)
            seen_s = picture.stamp_s + min(self._delays_s) if self._is_stamped else now_s
            self._arrivals.append((seen_s, moves))
            self._waits_s.append(waited_s)
            if self._is_stamped or waited_s >= _WAITED * np.median(self._waits_s):
                self._newest = picture, seen_s
            self._changed.notify_all()

    def _switch(self) -> None:
        with self._changed:
            if self._light is not None and isinstance(self._camera, Switches):
                self._camera.light(self._light)
            self._light = None
            self._changed.notify_all()

    def _latency_s(self, arrivals: Array) -> float:
        """The largest latency that pictures may have [s]."""
        if not self.is_live:
            return 0.0
        spans = self._arms.spans
        shown = arrivals[arrivals[:, 0] >= spans[0][0]] if spans else arrivals[:0]
        found = latency_of(spans, shown[:, 0], shown[:, 1] > 0)
        if found is not None:
            self._report(found)
            self._latencies = {**self._latencies, spans[0][0]: found}
        known_s = max((each.high_s for each in list(self._latencies.values())[-_MOTIONS:]), default=0.0)
        if found is not None or (self._latencies and not spans):
            return known_s
        interval_s = float(np.median(np.diff(arrivals[:, 0]))) if len(arrivals) > 1 else 0.0
        return max(_UNKNOWN_S, _UNKNOWN_PICTURES * interval_s, _GROWTH * known_s)

    def _report(self, found: Latency) -> None:
        before = self._reported
        if before is None or found.low_s > before.high_s:
            self._reported = found
            then = f", {before} before" if before else ""
            self._notes.append(f"camera {self._name}: pictures arrive {found} after exposure{then} (measured)")


class LightFeed(CameraFeed):
    """Likewise, of a camera that switches the light it looks at."""

    def light(self, on: bool) -> None:
        """Switch the light, between two pictures.

        Raises:
            DriverError: if the camera is silent.
        """
        self._go_on()
        with self._changed:
            self._light = on
            self._wait(lambda: self._light is None)


def fed(name: str, camera: Camera, arms: ArmMotion) -> Camera:
    """A camera as a capture takes pictures from it: read without pause, unless it exposes each when asked.

    Args:
        name: Of the camera.
        camera: As its driver gives it.
        arms: When arms move.
    """
    if getattr(camera, "is_on_demand", not camera.is_live):
        return camera
    return (LightFeed if isinstance(camera, Switches) else CameraFeed)(name, camera, arms)
