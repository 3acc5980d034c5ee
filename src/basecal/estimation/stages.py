"""Where the time of a calibration goes, by stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal

StageName = Literal[
    "features",
    "tracks",
    "joining",
    "clocks",
    "problem",
    "start",
    "descent",
    "observability",
    "noise",
    "conventions",
    "outliers",
    "stated sigmas",
    "robot model",
    "systematic errors",
    "certificate",
    "cross-validation",
    "findings",
    "task",
    "report",
]
"""Stages of a calibration, and of its report."""


class Stages:
    """Time by stage, and word of each as it begins.

    Args:
        notify: Called with the name of each stage as it begins, and as parts of it are done.
        clock: Where the time comes from [s].

    Attributes:
        seconds: By stage, in the order in which they first began [s].
    """

    def __init__(
        self, notify: Callable[[str], None] | None = None, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self.seconds: dict[str, float] = {}
        self._clock = clock
        self._notify = notify
        self._running = ""

    def part(self, done_count: int, total: int) -> None:
        """Report how much of the present stage is done."""
        if self._notify is not None and self._running:
            self._notify(f"{self._running}, {done_count} of {total}")

    @contextmanager
    def stage(self, name: StageName) -> Iterator[None]:
        """Count what is done inside as time of a stage; within another stage it is part of that one."""
        if self._running:
            yield
            return
        if self._notify is not None:
            self._notify(name)
        self._running = name
        began = self._clock()
        try:
            yield
        finally:
            self._running = ""
            self.seconds[name] = self.seconds.get(name, 0.0) + self._clock() - began
