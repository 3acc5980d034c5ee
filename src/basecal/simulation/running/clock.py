"""The time of a running cell: that of the clock on the wall, faster, or as it is spent."""

from __future__ import annotations

import time


class Clock:
    """Seconds since the cell began to run.

    With a `speed` of 0 time advances only while somebody waits, by exactly as much. The behaviour of a cell then
    depends on its requests alone, not on the load of the machine.

    Attributes:
        speed: Seconds of the cell in a second on the wall.
    """

    def __init__(self, speed: float = 1.0) -> None:
        self.speed = speed
        self._began, self._spent = time.monotonic(), 0.0

    def time_s(self) -> float:
        """The time [s]."""
        return self._spent if self.speed == 0 else (time.monotonic() - self._began) * self.speed

    def wait(self, seconds: float) -> float:
        """The time after so many seconds of the cell."""
        if self.speed == 0:
            self._spent += seconds
        else:
            time.sleep(seconds / self.speed)
        return self.time_s()
