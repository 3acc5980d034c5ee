"""Output of commands: text without control characters, one JSON object for programs, progress for people."""

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

if TYPE_CHECKING:
    from basecal.cell import Finding
    from basecal.estimation.stages import StageName

_COLOURS = {"good": 32, "doubtful": 33, "refused": 31}  # codes of terminals, by verdict


def say(text: str, to: TextIO | None = None) -> None:
    """Print a text and a newline, to stdout by default.

    Characters that the stream cannot encode, such as in a name that is not UTF-8, are escaped.

    Raises:
        OSError: if the stream is closed or full.
    """
    stream = sys.stdout if to is None else to
    if stream is None:
        raise OSError(errno.EBADF, "cannot be written to, it is closed", "stdout" if to is None else "stderr")
    encoding = stream.encoding or "utf-8"
    print(printable(text).encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)


def finding_line(finding: Finding) -> str:
    """A finding as a line of text: severity, code and message."""
    return f"{finding.severity}: {finding.code}: {finding.message}"


def say_next(words: str) -> None:
    """Print the next command to stderr, since a program may read stdout."""
    if sys.stderr is not None:
        say(f"next: {words}", sys.stderr)


def say_verdict(text: str, colour: str) -> None:
    """Print a text, its first word in colour on a terminal if NO_COLOR is not set."""
    if is_terminal(sys.stdout) and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb":
        word, colon, text = text.partition(":")
        sys.stdout.write(f"\x1b[1;{_COLOURS[colour]}m{printable(word)}\x1b[0m{colon}")
    say(text)


def is_terminal(stream: TextIO | None) -> bool:
    """Whether a stream is a terminal; a closed stream is None."""
    return stream is not None and stream.isatty()


def can_ask() -> bool:
    """Whether questions can be asked on a terminal."""
    return is_terminal(sys.stdin) and is_terminal(sys.stderr)


def ask(question: str, silence_error: str, refusal_error: str) -> None:
    """Ask a question on a terminal.

    Args:
        question: A question for yes or no.
        silence_error: Message of the error if there is no terminal.
        refusal_error: Message of the error if the user refuses.

    Raises:
        UsageError: if there is no terminal, or the user refuses.
    """
    if not can_ask():
        raise UsageError(silence_error)
    say(f"{question} [y/N]", sys.stderr)
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise UsageError(refusal_error)


def quote_path(path: object) -> str:
    """A path quoted for a shell."""
    return quote(str(path))


def print_json(answer: Mapping[str, Any]) -> None:
    """Print one JSON object to stdout."""
    say(json.dumps(answer, allow_nan=False))


@contextmanager
def progress(message: str) -> Iterator[Callable[[str], None]]:
    """A line on stderr with the current stage and the time left; nothing if stderr is not a terminal."""
    if not is_terminal(sys.stderr):
        yield lambda now: None
        return
    from rich.console import Console

    left = TimeLeft(message)
    with Console(stderr=True).status(left):
        yield left.enter


def print_stages(seconds: Mapping[str, float]) -> None:
    """Print the run time of each stage to stderr [s], the longest first."""
    for name, duration in sorted(seconds.items(), key=lambda stage: -stage[1]):
        say(f"{duration:8.3f} s  {name}", sys.stderr)
    say(f"{sum(seconds.values()):8.3f} s  all stages", sys.stderr)


# Run time of each stage relative to 100 for the solution and all its tests, in order. These are means over cells of 30
# to 300 samples, whose stages differ from them by a factor of three. Stages that are not listed count as 0.
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
_SHORTEST_S = 1.0  # smallest elapsed time and time left for which the time left is shown


class TimeLeft:
    """The current stage and the time left, as a line to show.

    Attributes:
        message: Name of the whole computation.
    """

    def __init__(self, message: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.message = message
        self._clock = clock
        self._began = self._stage_began = clock()
        self._stage = ""
        self._done_stages: set[str] = set()

    def enter(self, stage: str) -> None:
        """Note the start of a stage, which ends the previous one; text after a comma is the stage's progress."""
        previous, _, _ = self._stage.partition(",")
        if stage.partition(",")[0] == previous:
            self._stage = stage
            return
        if previous:
            self._done_stages.add(previous)
        self._stage, self._stage_began = stage, self._clock()

    def seconds(self) -> float | None:
        """Time left for all stages [s]; None if too little is known."""
        done = sum(share for stage, share in _SHARES.items() if stage in self._done_stages)
        elapsed = self._stage_began - self._began
        if not done or elapsed < _SHORTEST_S:
            return None
        return max(elapsed * (sum(_SHARES.values()) - done) / done - (self._clock() - self._stage_began), 0.0)

    def __str__(self) -> str:
        left = self.seconds()
        stage = f": {self._stage}" if self._stage else ""
        return f"{self.message}{stage}" + (f", about {left:.0f} s left" if left and left >= _SHORTEST_S else "")

    def __rich__(self) -> str:
        return str(self)


Step = Callable[[int, int], None]


@contextmanager
def progress_bar(activity: str) -> Iterator[Step]:
    """A progress bar on stderr for counted steps; nothing if stderr is not a terminal."""
    if not is_terminal(sys.stderr):
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(activity)
        yield lambda done, total: bar.update(task, completed=done, total=total)
