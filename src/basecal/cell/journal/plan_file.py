"""Plans of samples to be taken: lines in the format of a recording that hold only robot states."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from basecal.bounded_file import read_bounded
from basecal.cell.cell import Cell
from basecal.cell.format.paths import inside
from basecal.cell.format.writing import write_atomically
from basecal.cell.journal.recording_file import BOM, FOLDER, LARGEST_BYTES, sample_line
from basecal.cell.journal.sample_line import context, sample_from_line
from basecal.cell.journal.sample_values import Where
from basecal.cell.recording import Sample


def read_plan(path: str | Path, folder: str | Path, cell: Cell) -> tuple[Sample, ...]:
    """Read the samples of a plan, each with its number and the planned robot states.

    Args:
        path: The plan, as lines or as one object with all `samples`, or a recording to repeat.
        folder: The cell's folder.
        cell: The cell.

    Raises:
        DatasetError: if a line is invalid, or has no robot state.
    """
    expected = "a plan has one JSON object a line, with its robots"
    text = read_bounded(Path(path), LARGEST_BYTES, expected).removeprefix(BOM)
    try:
        whole = json.loads(text)
    except (ValueError, RecursionError):
        whole = None  # one line per sample
    samples = whole.get("samples") if isinstance(whole, dict) else None
    if isinstance(samples, list):  # one object, as printed by `basecal plan --json`
        return parse_plan([json.dumps(each).encode() for each in samples], path, folder, cell)
    return parse_plan(text.split(b"\n"), path, folder, cell)


def parse_plan(lines: Iterable[bytes], path: str | Path, folder: str | Path, cell: Cell) -> tuple[Sample, ...]:
    """Parse the lines of a plan; see `read_plan`."""
    known = context(cell, inside(str(folder), FOLDER))
    samples: list[Sample] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        where = Where(str(path), number)
        read = sample_from_line(line, where, known)
        if not isinstance(read, Sample) or not read.robots:
            raise where.error("robots", "expected the planned joints or flange poses of robots")
        samples.append(Sample(read.sample, robots=read.robots))
    return tuple(samples)


def write_plan(samples: Iterable[Sample], path: Path, folder: Path) -> None:
    """Write a plan atomically to a path inside a folder.

    Raises:
        InputError: if the plan cannot be written.
    """
    write_atomically(path, "".join(map(sample_line, samples)), base_folder=folder)
