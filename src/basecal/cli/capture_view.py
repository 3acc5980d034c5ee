"""Views of a running capture: lines of text, a live view on a terminal, and a page if requested."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.terminal import is_terminal, say
from basecal.errors import sentence

if TYPE_CHECKING:
    from basecal.acquisition.capture import Step
    from basecal.acquisition.rig import Rig
    from basecal.acquisition.watching import Watch
    from basecal.cell import Cell

_UPDATES_PER_S = 4  # updates of the live view


@dataclass(frozen=True, eq=False)
class CaptureView:
    """Output of a capture, and key presses of the user.

    Attributes:
        watch: The state to show.
        key: Function that returns the key pressed since the last call.
        has_lines: Whether each sample is printed as a line, if there is no live view.
    """

    watch: Watch
    key: Callable[[], str]
    has_lines: bool

    def report(self, words: str) -> None:
        """Report a message to the user."""
        self.watch.report(words)
        if self.has_lines:
            say(words)

    def note(self, step: Step) -> None:
        """Report the result of a sample."""
        self.watch.note(step)
        if self.has_lines:
            say_step(step)


@contextmanager
def capture_view(rig: Rig, cell: Cell, folder: Path, web: bool, port: int, quiet: bool) -> Iterator[CaptureView]:
    """A context that shows a capture.

    Args:
        rig: The robots and cameras; if one of them asks on the terminal, there is no live view.
        cell: The cell that is captured.
        folder: The cell's folder.
        web: Whether to serve a page.
        port: Port of the page; 0 selects a free one.
        quiet: Whether standard output is reserved for JSON.

    Raises:
        InputError: if the port is in use.
        KeyboardInterrupt: if the user interrupts; the message says what is kept.
    """
    from basecal.acquisition.watching import End, Watch

    watch = Watch()
    rig.arms.show = watch.note_state
    with ExitStack() as contexts:
        if web:
            from basecal.reporting.live.page import serve_page

            say(
                f"the capture is shown at {contexts.enter_context(serve_page(watch, cell, rig.request_stop, port))}",
                sys.stderr,
            )
        is_live = [*(each.is_live for each in rig.robots.values()), *(each.is_live for each in rig.cameras.values())]
        asks_on_terminal = not all(is_live)
        has_live_view = is_terminal(sys.stdout) and not quiet and not asks_on_terminal
        key = (lambda: "") if asks_on_terminal else contexts.enter_context(pressed_keys())
        if has_live_view:
            from rich.live import Live

            from basecal.reporting.live.terminal import terminal_view

            contexts.enter_context(
                Live(get_renderable=lambda: terminal_view(watch.snapshot), refresh_per_second=_UPDATES_PER_S)
            )
        try:
            yield CaptureView(watch, key, not has_live_view and not quiet)
        except KeyboardInterrupt:
            words = f"interrupted: {_kept_text(folder)}, and the same command goes on"
            watch.end(End("STOPPED", sentence(words)))
            raise KeyboardInterrupt(words) from None
        except BaseException as error:
            watch.end(End("STOPPED", str(error) or "The capture ended; what was recorded is kept."))
            raise


def _kept_text(folder: Path) -> str:
    """Text with the number of samples in the recording; each line is written when its sample is complete."""
    path = folder / "recording" / "samples.jsonl"
    count = len(path.read_bytes().splitlines()) if path.is_file() else 0
    return "1 sample is kept" if count == 1 else f"{count} samples are kept"


def say_step(step: Step) -> None:
    """Print the result of a sample."""
    from basecal.reporting.statement.verdict import error_text

    sigma = (
        "" if step.sigma is None else f"; base known to {error_text(*step.sigma)} (1 sigma, 3-D norm{step.sigma_note})"
    )
    result = f"not taken: {step.why_not}" if step.why_not else f"taken, {100 * step.coverage.share:.0f} % of the image"
    advice = step.coverage.advice(step.taken)
    say(f"{step.taken:4d}/{step.planned} sample {step.sample}: {result}{sigma}{'; ' + advice if advice else ''}")
    for doubt in step.doubts:
        say(f"  {'WARNING' if doubt.is_lasting else 'check'}: {doubt.message}")


@contextmanager
def pressed_keys() -> Iterator[Callable[[], str]]:
    """A context with a function that returns the key pressed since the last call; empty without a terminal."""
    stream = sys.stdin
    if stream is None or not stream.isatty() or sys.platform == "win32":
        yield lambda: ""
        return
    import select
    import termios
    import tty

    descriptor = stream.fileno()
    attributes = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    try:  # the stream itself would buffer further keys, which `select` does not see
        yield (
            lambda: os.read(descriptor, 1).decode(errors="replace") if select.select([descriptor], [], [], 0)[0] else ""
        )
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, attributes)
