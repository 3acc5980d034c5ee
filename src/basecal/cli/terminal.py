"""Output of a command: text that cannot steer a terminal, one JSON object for programs, progress for people."""

from __future__ import annotations

import errno
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from shlex import quote
from typing import Any, TextIO

from basecal.cli.time_left import TimeLeft
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
