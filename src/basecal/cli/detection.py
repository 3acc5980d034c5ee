"""The recording of a cell with its detections, made where it holds none yet."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.terminal import is_terminal

if TYPE_CHECKING:
    from basecal.cell import Cell, Recording

Step = Callable[[int, int], None]


def detected_recording(folder: Path, cell: Cell) -> Recording:
    """The recording of a cell's folder with what is detected in its images; a bar shows how far the detection is."""
    from basecal.accuracy.input_screening.units import needs_search
    from basecal.cell.files import read_recording

    recording = read_recording(folder, cell)
    if not needs_search(cell, recording):
        return recording
    from basecal.vision.detect import detect

    with counting("detecting") as step:
        return detect(cell, recording, progress=step)


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
