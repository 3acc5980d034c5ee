"""What came of one trial, and what may: an answer, a refusal in words, never anything else."""

from __future__ import annotations

import contextlib
import io
import re
import signal
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from basecal.cli import main
from basecal.errors import BasecalError
from tests.shared.machine_unit import unit_s

LONGEST_UNITS = (
    4000  # of the processor, of a trial with a dozen samples, the slowest of which take 2200: more is a hang
)
_WAITING = 10  # times as long by the clock: beside other programs, or waiting for what never comes
_IDLE_S = 0.1  # of the processor, while so much of the clock went by: it waits
CODES = {0: "answered", 1: "answered", 4: "answered", 5: "answered", 2: "refused", 3: "refused", 130: "interrupted"}


class TrialFailed(AssertionError):
    """A trial ended as none may."""


@cache
def longest_s() -> float:
    """Limit of CPU time of a trial on this machine [s], 32 s where a unit takes 8 ms."""
    return LONGEST_UNITS * unit_s()


@contextlib.contextmanager
def time_limit(seconds: float | None = None) -> Iterator[None]:
    """Raise `TrialFailed` if the context takes longer, by default than `longest_s`."""
    seconds = longest_s() if seconds is None else seconds
    last_s = time.process_time()

    def hang(sent: int, _: object) -> None:
        nonlocal last_s
        if sent == signal.SIGALRM and time.process_time() - last_s > _IDLE_S:
            last_s = time.process_time()  # other programs have the processor: what works on is told by its own time
            signal.setitimer(signal.ITIMER_REAL, _WAITING * seconds)
            return
        raise TrialFailed(f"took more than {seconds:.3g} s")

    limits = ((signal.SIGPROF, signal.ITIMER_PROF, 1), (signal.SIGALRM, signal.ITIMER_REAL, _WAITING))
    before = [signal.signal(sent, hang) for sent, _, _ in limits]
    for _, timer, times in limits:
        signal.setitimer(timer, times * seconds)
    try:
        yield
    finally:
        for (sent, timer, _), handler in zip(limits, before, strict=True):
            signal.setitimer(timer, 0)
            signal.signal(sent, handler)


def run_reader(read: Callable[[], object]) -> str:
    """`answered` or `refused`; any error that is none of ours, and one that is not a line each, falls.

    Raises:
        TrialFailed: with the error as its cause.
    """
    try:
        with time_limit():
            read()
    except BasecalError as error:
        if not str(error).strip() or "\x1b" in str(error) or len(str(error)) > 100_000:
            raise TrialFailed(f"refused by {str(error)[:80]!r}") from error
        return "refused"
    except TrialFailed:
        raise
    except Exception as error:
        raise TrialFailed(f"{type(error).__name__}: {error}") from error
    return "answered"


def run_command(words: list[str]) -> tuple[str, int, str]:
    """What came of a command, its exit code, and what it printed.

    Raises:
        TrialFailed: by an exit code outside the contract, an error of several lines, or an escape sequence.
    """
    out, err = io.StringIO(), io.StringIO()
    with time_limit(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    if code not in CODES:
        raise TrialFailed(f"exit code {code}: {err.getvalue().strip()[-300:]}{_traceback(err.getvalue())}")
    if CODES[code] == "refused" and err.getvalue().count("\n") != 1:
        raise TrialFailed(f"an error of {err.getvalue().count(chr(10))} lines: {err.getvalue()[:200]!r}")
    if "\x1b" in out.getvalue() + err.getvalue():
        raise TrialFailed("an escape sequence reaches the terminal")
    return CODES[code], code, out.getvalue()


def _traceback(said: str) -> str:
    """The last lines of the traceback that a fault was written to, which is removed."""
    found = re.search(r"please report it with (\S+)", said)
    if found is None:
        return ""
    path = Path(found[1])
    lines = [line.strip() for line in path.read_text().splitlines() if line.strip().startswith("File")]
    path.unlink()
    return " <- " + " <- ".join(reversed(lines[-3:]))
