"""Plans of samples to be taken: lines in the format of a recording that hold only robot states."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from basecal.bounded_file import read_bounded
from basecal.cell.cell import Cell
from basecal.cell.format.paths import path_resolver
from basecal.cell.format.writing import write_atomically
from basecal.cell.journal.recording_file import BOM, FOLDER, LARGEST_BYTES, sample_line
from basecal.cell.journal.sample_line import make_context, sample_from_line
from basecal.cell.journal.sample_values import FileLine
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
        data = json.loads(text)
    except (ValueError, RecursionError):
        data = None  # one line per sample
    samples = data.get("samples") if isinstance(data, dict) else None
    if isinstance(samples, list):  # one object, as printed by `basecal plan --json`
        return parse_plan([json.dumps(each).encode() for each in samples], path, folder, cell)
    return parse_plan(text.split(b"\n"), path, folder, cell)


def parse_plan(lines: Iterable[bytes], path: str | Path, folder: str | Path, cell: Cell) -> tuple[Sample, ...]:
    """Parse the lines of a plan; see `read_plan`."""
    context = make_context(cell, path_resolver(str(folder), FOLDER))
    samples: list[Sample] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        file_line = FileLine(str(path), number)
        sample = sample_from_line(line, file_line, context)
        if not isinstance(sample, Sample) or not sample.robots:
            raise file_line.error("robots", "expected the planned joints or flange poses of robots")
        samples.append(Sample(sample.sample, robots=sample.robots))
    return tuple(samples)


def write_plan(samples: Iterable[Sample], path: Path, folder: Path) -> None:
    """Write a plan atomically to a path inside a folder.

    Raises:
        InputError: if the plan cannot be written.
    """
    write_atomically(path, "".join(map(sample_line, samples)), base_folder=folder)
