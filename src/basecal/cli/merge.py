"""`basecal merge`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import CycloptsError, Parameter

from basecal.cli.terminal import quote_path, say, say_next
from basecal.errors import count_text

_FEWEST_PARTS = 2


def merge(*cells: Path, output: Annotated[Path, Parameter(alias="-o")]) -> int:
    """Merge cells that were recorded separately, such as each arm with the other
    at rest.

    Robots, cameras and targets with the same name must be equal in all cells; the
    others are added. The first cell's reference and comments are kept, samples
    are renumbered, images and URDFs are copied. The source cells do not change.

    For example:

        basecal merge left_moves right_moves -o both

    Args:
        cells: Folders of two cells or more.
        output: Folder to make.
    """
    from basecal.exchange.merging import merge_cells

    if len(cells) < _FEWEST_PARTS:
        raise CycloptsError(msg="give two cells or more: basecal merge A B -o C")
    merged = merge_cells(cells, output)
    for source, first in zip(merged.parts, merged.first_numbers, strict=True):
        samples = source.recording.samples
        robots = ", ".join(dict.fromkeys(name for sample in samples for name in sample.robots)) or "no robot"
        say(f"{source.folder}: {count_text(len(samples), 'sample')} of {robots}, from number {first} on")
        for finding in source.recording.findings:
            say(f"left out: {finding.message}")
    say(f"{count_text(len(merged.recording.samples), 'sample')} written to {output}")
    say_next(f"basecal calibrate {quote_path(output)}")
    return 0
