"""Where the time of a calibration goes, by stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Stages:
    """Wall time by stage, and word of each as it begins.

    Attributes:
        seconds: By stage, in the order in which they first began [s].
    """

    def __init__(self, tell: Callable[[str], None] | None = None) -> None:
        self.seconds: dict[str, float] = {}
        self._tell = tell
        self._running = False

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count what is done inside as time of a stage; within another stage it is part of that one."""
        if self._running:
            yield
            return
        if self._tell is not None:
            self._tell(name)
        self._running = True
        began = time.perf_counter()
        try:
            yield
        finally:
            self._running = False
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - began
