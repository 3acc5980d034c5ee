"""`basecal new`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from basecal.cli.template import Kind, cell_text
from basecal.cli.terminal import pasted, say
from basecal.errors import InputError


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
    start_cell(cell, cell_text(robots, target))
    samples = cell / "recording" / "samples.jsonl"
    samples.parent.mkdir(exist_ok=True)
    samples.touch()
    then = f"basecal calibrate {pasted(cell)}"
    say(f"wrote {cell / 'cell.yaml'}: fill in what is known, record into {samples}, then: {then}")
    return 0


def start_cell(folder: Path, text: str) -> None:
    """Write a `cell.yaml` into a folder, which is made.

    Raises:
        InputError: if there is one already.
    """
    path = folder / "cell.yaml"
    if path.exists():
        raise InputError(f"{path} exists and is not overwritten: choose another folder, or remove it first")
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
