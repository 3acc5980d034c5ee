"""Time of a calibration, by stage."""

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
    """Count time by stage, and report progress.

    Args:
        notify: Called with the name of each stage when it begins, and when parts of it are done.
        clock: Function that returns the time [s].

    Attributes:
        seconds: Time by stage, in the order in which the stages first began [s].
    """

    def __init__(
        self, notify: Callable[[str], None] | None = None, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self.seconds: dict[str, float] = {}
        self._clock = clock
        self._notify = notify
        self._running = ""

    def report_progress(self, done_count: int, total: int) -> None:
        """Report how much of the present stage is done."""
        if self._notify is not None and self._running:
            self._notify(f"{self._running}, {done_count} of {total}")

    @contextmanager
    def stage(self, name: StageName) -> Iterator[None]:
        """Context whose time counts for a stage; inside another stage, it counts for the outer stage."""
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
