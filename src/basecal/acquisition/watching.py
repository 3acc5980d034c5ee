"""The state of a capture for people who watch it, on any surface."""

from __future__ import annotations

import statistics
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

from basecal.acquisition.capture import Step
from basecal.acquisition.driver import Grey
from basecal.cell import RobotState

_LINE_COUNT = 8  # of what has become of samples, that are shown
_RECENT_STEPS = 6  # by whose duration it is estimated how long the others take


@dataclass(frozen=True)
class Sigma:
    """How well the base is known after so many `samples`: 3-D norms of the sigmas [m] and [rad]."""

    samples: int
    t_m: float
    r_rad: float


@dataclass(frozen=True)
class End:
    """How a capture ended: the verdict in one word, why in a sentence, and what to type next."""

    word: str
    sentence: str
    command: str = ""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A capture at an instant.

    Attributes:
        doing: What is done now, in words.
        step: What has become of the last sample; None before the first.
        sigmas: After each sample since all directions were seen.
        said: What has become of the last samples, a line each.
        doubts: What disagrees for the rest of the capture, a line each.
        images: The last one of each camera.
        states: The last one of each robot.
        goals: Where each robot was sent last.
        failures: Samples that were not taken, and why.
        times_s: When each sample was finished, by the clock of the watch.
        tolerance_m: The error at the task that is needed; None if nothing is.
        errors: The expected error at the task [m] after so many samples.
        end: How it ended; None while it goes on.
    """

    doing: str = "opening robots and cameras"
    step: Step | None = None
    sigmas: tuple[Sigma, ...] = ()
    said: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    images: tuple[tuple[str, Grey], ...] = ()
    states: tuple[tuple[str, RobotState], ...] = ()
    goals: tuple[tuple[str, RobotState], ...] = ()
    failures: tuple[tuple[int, str], ...] = ()
    times_s: tuple[float, ...] = ()
    tolerance_m: float | None = None
    errors: tuple[tuple[int, float], ...] = ()
    end: End | None = None

    @property
    def time_left_s(self) -> float | None:
        """How long the samples that are left take, as the last ones did; None before there are two."""
        recent = self.times_s[-_RECENT_STEPS:]
        if self.step is None or len(recent) < 2:
            return None
        each = statistics.median(after - before for before, after in pairwise(recent))
        return max(self.step.planned - self.step.taken, 0) * each

    @property
    def advice(self) -> str:
        """Advice to cover more; empty if there is none."""
        return "" if self.step is None else self.step.coverage.advice(self.step.taken)


class Watch:
    """Keeps what is to be shown; one thread captures, others look."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._lock = threading.Lock()
        self._snapshot = Snapshot()
        self._clock = clock

    @property
    def snapshot(self) -> Snapshot:
        """The capture as it is now."""
        with self._lock:
            return self._snapshot

    def notify(self, words: str) -> None:
        """Note what is done now."""
        with self._lock:
            self._snapshot = replace(self._snapshot, doing=words)

    def note(self, step: Step) -> None:
        """Note what has become of a sample."""
        line = f"sample {step.sample}: {'not taken: ' + step.why_not if step.why_not else 'taken'}"
        with self._lock:
            before = self._snapshot
            sigmas = before.sigmas
            if step.sigma is not None and not step.why_not:
                sigmas = (*sigmas, Sigma(step.taken, *step.sigma))
            said = (*before.said, line, *(doubt.message for doubt in step.doubts))[-_LINE_COUNT:]
            doubts = (*before.doubts, *(doubt.message for doubt in step.doubts if doubt.is_lasting))
            failures = (*before.failures, (step.sample, step.why_not)) if step.why_not else before.failures
            times_s = (*before.times_s, self._clock())
            self._snapshot = replace(
                before, step=step, sigmas=sigmas, said=said, doubts=doubts, failures=failures, times_s=times_s
            )

    def note_error(self, tolerance_m: float, error_m: float | None) -> None:
        """Note the tolerance at the task, and the error that is expected there with the samples so far."""
        with self._lock:
            before = self._snapshot
            taken = 0 if before.step is None else before.step.taken
            errors = before.errors if error_m is None else (*before.errors, (taken, error_m))
            self._snapshot = replace(before, tolerance_m=tolerance_m, errors=errors)

    def report(self, words: str) -> None:
        """Note what a person should know."""
        with self._lock:
            self._snapshot = replace(self._snapshot, said=(*self._snapshot.said, words)[-_LINE_COUNT:])

    def note_image(self, camera: str, grey: Grey) -> None:
        """Note an image."""
        self._keep("images", camera, grey)

    def note_state(self, robot: str, state: RobotState) -> None:
        """Note where a robot is."""
        self._keep("states", robot, state)

    def note_goal(self, robot: str, goal: RobotState) -> None:
        """Note where a robot is sent."""
        self._keep("goals", robot, goal)

    def _keep(self, kind: Literal["images", "states", "goals"], name: str, value: object) -> None:
        """Note the last value of a camera or robot."""
        with self._lock:
            kept = {**dict(getattr(self._snapshot, kind)), name: value}
            changes: dict[str, Any] = {kind: tuple(kept.items())}
            self._snapshot = replace(self._snapshot, **changes)

    def end(self, end: End) -> None:
        """Note how it ended; the first end counts."""
        with self._lock:
            self._snapshot = replace(self._snapshot, end=self._snapshot.end or end)
