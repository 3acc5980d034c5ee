"""`basecal new`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from basecal.cli.template import Kind, cell_text
from basecal.cli.terminal import pasted, say


def new(
    cell: Path,
    /,
    *,
    robots: Annotated[int, Parameter(validator=validators.Number(gte=1, lte=9))] = 2,
    target: Kind = "charuco",
) -> int:
    """Write a working cell.yaml to fill in, and an empty recording.

    One robot: a camera on its flange looks at a target on the world. Two: the
    camera is on `eye`, the target on `hand`. More: each robot's camera sees the
    target of the next. An existing cell is never overwritten.

    For example:

        basecal new mycell --robots 2 --target charuco
        basecal calibrate mycell

    Args:
        cell: Folder to make.
        robots: How many robots.
        target: What the cameras look at; `pose` where another program gives the target's pose.
    """
    from basecal.cell.format.writing import make_folder, open_new

    start_cell(cell, cell_text(robots, target))
    samples = cell / "recording" / "samples.jsonl"
    make_folder(samples.parent, cell)
    if not os.path.lexists(samples):
        open_new(samples).close()
    then = f"basecal calibrate {pasted(cell)}"
    say(f"wrote {cell / 'cell.yaml'}: fill in what is known, record into {samples}, then: {then}")
    return 0


def start_cell(folder: Path, text: str) -> None:
    """Write a `cell.yaml` into a folder, which is made.

    Raises:
        InputError: if there is one already.
    """
    from basecal.cell.format.writing import write_new

    write_new(folder / "cell.yaml", text)
