"""The progress of a capture for display in any user interface."""

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

_LINE_COUNT = 8  # lines about the last samples that are shown
_RECENT_STEPS = 6  # from whose durations the remaining time is estimated


@dataclass(frozen=True)
class Sigma:
    """3-D norms of the base's sigmas [m] and [rad] after a number of `samples`."""

    samples: int
    t_m: float
    r_rad: float


@dataclass(frozen=True)
class End:
    """End of a capture: the verdict in one word, the reason in a sentence, and the command to enter next."""

    word: str
    sentence: str
    command: str = ""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A capture at an instant.

    Attributes:
        activity: Description of the current step.
        step: Result of the last sample; None before the first one.
        sigmas: Sigmas of the base after each sample, since all directions are observable.
        lines: Lines about the last samples.
        doubts: Lines about disagreements that last for the rest of the capture.
        images: The last image of each camera.
        states: The last state of each robot.
        goals: The last goal of each robot.
        failures: Numbers of samples that were not taken, with the reasons.
        times_s: Time at which each sample was finished [s], by the clock of the watch.
        tolerance_m: Required error at the task [m]; None if not stated.
        errors: (number of samples, expected error at the task [m]).
        end: End of the capture; None while it is running.
    """

    activity: str = "opening robots and cameras"
    step: Step | None = None
    sigmas: tuple[Sigma, ...] = ()
    lines: tuple[str, ...] = ()
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
        """Estimated duration of the remaining samples [s], from the last ones; None before the second sample."""
        recent = self.times_s[-_RECENT_STEPS:]
        if self.step is None or len(recent) < 2:
            return None
        duration_s = statistics.median(after - before for before, after in pairwise(recent))
        return max(self.step.planned - self.step.taken, 0) * duration_s

    @property
    def advice(self) -> str:
        """Advice to improve the coverage; empty if there is none."""
        return "" if self.step is None else self.step.coverage.advice(self.step.taken)


class Watch:
    """Thread-safe store of a capture's snapshot: one thread captures, others read."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._lock = threading.Lock()
        self._snapshot = Snapshot()
        self._clock = clock

    @property
    def snapshot(self) -> Snapshot:
        """The current state of the capture."""
        with self._lock:
            return self._snapshot

    def notify(self, words: str) -> None:
        """Note the current step."""
        with self._lock:
            self._snapshot = replace(self._snapshot, activity=words)

    def note(self, step: Step) -> None:
        """Note the result of a sample."""
        result = f"sample {step.sample}: {'not taken: ' + step.why_not if step.why_not else 'taken'}"
        with self._lock:
            previous = self._snapshot
            sigmas = previous.sigmas
            if step.sigma is not None and not step.why_not:
                sigma = Sigma(step.taken - step.unchecked, *step.sigma)
                sigmas = (*(each for each in sigmas if each.samples < sigma.samples), sigma)
            lines = (*previous.lines, result, *(doubt.message for doubt in step.doubts))[-_LINE_COUNT:]
            doubts = (*previous.doubts, *(doubt.message for doubt in step.doubts if doubt.is_lasting))
            failures = (*previous.failures, (step.sample, step.why_not)) if step.why_not else previous.failures
            times_s = (*previous.times_s, self._clock())
            self._snapshot = replace(
                previous, step=step, sigmas=sigmas, lines=lines, doubts=doubts, failures=failures, times_s=times_s
            )

    def note_error(self, tolerance_m: float, error_m: float | None) -> None:
        """Note the tolerance at the task, and the error expected with the samples so far [m]."""
        with self._lock:
            previous = self._snapshot
            taken = 0 if previous.step is None else previous.step.taken
            errors = previous.errors if error_m is None else (*previous.errors, (taken, error_m))
            self._snapshot = replace(previous, tolerance_m=tolerance_m, errors=errors)

    def report(self, words: str) -> None:
        """Note a message for the user."""
        with self._lock:
            self._snapshot = replace(self._snapshot, lines=(*self._snapshot.lines, words)[-_LINE_COUNT:])

    def note_image(self, camera: str, grey: Grey) -> None:
        """Note an image."""
        self._keep("images", camera, grey)

    def note_state(self, robot: str, state: RobotState) -> None:
        """Note the state of a robot."""
        self._keep("states", robot, state)

    def note_goal(self, robot: str, goal: RobotState) -> None:
        """Note the goal of a robot."""
        self._keep("goals", robot, goal)

    def _keep(self, kind: Literal["images", "states", "goals"], name: str, value: object) -> None:
        """Replace the last value of a camera or robot."""
        with self._lock:
            kept = {**dict(getattr(self._snapshot, kind)), name: value}
            changes: dict[str, Any] = {kind: tuple(kept.items())}
            self._snapshot = replace(self._snapshot, **changes)

    def end(self, end: End) -> None:
        """Note the end of the capture; later calls have no effect."""
        with self._lock:
            self._snapshot = replace(self._snapshot, end=self._snapshot.end or end)
