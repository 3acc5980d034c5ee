"""Output of a command: text that cannot steer a terminal, one JSON object for programs, progress for people."""

from __future__ import annotations

import errno
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from shlex import quote
from typing import TYPE_CHECKING, Any, TextIO

from basecal.errors import UsageError, printable

_COLOURS = {"good": 32, "doubtful": 33, "refused": 31}  # codes of terminals, by verdict


def say(text: str, to: TextIO | None = None) -> None:
    """Print a text and a newline, on stdout where nothing else is said.

    What the stream cannot encode, such as a name that is not UTF-8, is written out.

    Raises:
        OSError: if the stream is closed or full.
    """
    stream = sys.stdout if to is None else to
    if stream is None:
        raise OSError(errno.EBADF, "cannot be written to, it is closed", "stdout" if to is None else "stderr")
    encoding = stream.encoding or "utf-8"
    print(printable(text).encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)


def say_next(words: str) -> None:
    """Print what to type next, on stderr: what is on stdout may be read by a program."""
    if sys.stderr is not None:
        say(f"next: {words}", sys.stderr)


def say_verdict(text: str, colour: str) -> None:
    """Print a text, its first word in a colour where a terminal shows it and NO_COLOR is not set."""
    if is_terminal(sys.stdout) and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb":
        word, colon, text = text.partition(":")
        sys.stdout.write(f"\x1b[1;{_COLOURS[colour]}m{printable(word)}\x1b[0m{colon}")
    say(text)


def is_terminal(stream: TextIO | None) -> bool:
    """Whether somebody watches a stream; one that is closed is None."""
    return stream is not None and stream.isatty()


def can_ask() -> bool:
    """Whether a person sees a question and can answer it."""
    return is_terminal(sys.stdin) and is_terminal(sys.stderr)


def ask(question: str, silence_error: str, refusal_error: str) -> None:
    """Ask on a terminal.

    Args:
        question: What is answered by yes or no.
        silence_error: If nobody can be asked.
        refusal_error: If the user refuses.

    Raises:
        UsageError: in either case.
    """
    if not can_ask():
        raise UsageError(silence_error)
    say(f"{question} [y/N]", sys.stderr)
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise UsageError(refusal_error)


def quote_path(path: object) -> str:
    """A path as one word of a line to paste into a shell."""
    return quote(str(path))


def print_json(answer: Mapping[str, Any]) -> None:
    """One JSON object on stdout."""
    say(json.dumps(answer, allow_nan=False))


@contextmanager
def progress(message: str) -> Iterator[Callable[[str], None]]:
    """A line on stderr that names what is done now and how long it takes still; nothing if stderr is no terminal."""
    if not is_terminal(sys.stderr):
        yield lambda now: None
        return
    from rich.console import Console

    left = TimeLeft(message)
    with Console(stderr=True).status(left):
        yield left.enter


def print_stages(seconds: Mapping[str, float]) -> None:
    """Where the time went [s], on stderr: the longest stage first."""
    for name, took in sorted(seconds.items(), key=lambda stage: -stage[1]):
        say(f"{took:8.3f} s  {name}", sys.stderr)
    say(f"{sum(seconds.values()):8.3f} s  all stages", sys.stderr)


if TYPE_CHECKING:
    from basecal.estimation.stages import StageName

# How long each stage takes of 100 that the solution and all its tests take, in their order; a mean over cells of 30 to
# 300 samples, whose stages differ by a factor of three from it. A stage that is not listed counts as nothing.
_SHARES: Mapping[StageName, int] = {
    "problem": 1,
    "start": 4,
    "descent": 1,
    "observability": 1,
    "noise": 32,
    "conventions": 40,
    "outliers": 4,
    "stated sigmas": 1,
    "robot model": 3,
    "systematic errors": 3,
    "certificate": 1,
    "cross-validation": 7,
    "findings": 2,
    "report": 35,
}
_SOONEST_S = 1.0  # before it, and less than it, nothing is said of the time


class TimeLeft:
    """The current stage and the time left, as a line to show.

    Attributes:
        message: What all of it is called.
    """

    def __init__(self, message: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.message = message
        self._clock = clock
        self._began = self._stage_began = clock()
        self._stage = ""
        self._seen: set[str] = set()

    def enter(self, stage: str) -> None:
        """Note that a stage begins, and the one before it has ended; or, after a comma, how much of it is done."""
        before, _, _ = self._stage.partition(",")
        if stage.partition(",")[0] == before:
            self._stage = stage
            return
        if before:
            self._seen.add(before)
        self._stage, self._stage_began = stage, self._clock()

    def seconds(self) -> float | None:
        """How long all stages take still [s]; None if too little is known."""
        done = sum(share for stage, share in _SHARES.items() if stage in self._seen)
        before = self._stage_began - self._began
        if not done or before < _SOONEST_S:
            return None
        return max(before * (sum(_SHARES.values()) - done) / done - (self._clock() - self._stage_began), 0.0)

    def __str__(self) -> str:
        left = self.seconds()
        stage = f": {self._stage}" if self._stage else ""
        return f"{self.message}{stage}" + (f", about {left:.0f} s left" if left and left >= _SOONEST_S else "")

    def __rich__(self) -> str:
        return str(self)


if TYPE_CHECKING:
    pass

Step = Callable[[int, int], None]


@contextmanager
def counting(activity: str) -> Iterator[Step]:
    """A bar on stderr for steps that are counted; nothing if stderr is not a terminal."""
    if not is_terminal(sys.stderr):
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(activity)
        yield lambda done, total: bar.update(task, completed=done, total=total)
