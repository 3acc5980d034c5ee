"""`basecal export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import CycloptsError, Parameter

from basecal.cli.terminal import pasted, say
from basecal.errors import InputError
from basecal.registry import EXPORTERS

_WHAT = "; ".join(f"--{name} {what}" for name, what in EXPORTERS.items())


def export(
    cell: Path,
    /,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    **what: Annotated[str, Parameter(help=f"What to write, one of: {_WHAT}.")],
) -> int:
    """Write the latest calibration for another program.

    What is written is said by an option of its own. With the URDF of a robot,
    its flange is where the calibrated one is at the joints that the robot
    records, and all else stays as it is.

    For example:

        basecal export mycell --urdf hand -o hand_corrected.urdf

    Args:
        cell: Folder of the cell.
        output: File to write.
        **what: Which program's file, and what of the cell goes into it.
    """
    from basecal.cell.files import latest_run, read_calibration, read_cell
    from basecal.cell.format.writing import write_whole
    from basecal.exchange.exporters.exporter import exporter

    if len(what) != 1 or not what.keys() <= EXPORTERS.keys():
        raise CycloptsError(msg=f"say one thing to export, got {', '.join(what) or 'none'}; there are: {_WHAT}")
    described, run = read_cell(cell), latest_run(cell)
    if run is None:
        raise InputError(f"{cell} has no run yet: basecal calibrate {pasted(cell)}")
    ((name, of),) = what.items()
    text = exporter(name).exported(described, cell, read_calibration(run), of)
    if output.exists() and not output.is_file():
        output.write_text(text, encoding="utf-8")  # a pipe or a device is not replaced
    else:
        write_whole(output, text)
    say(f"written: {output}")
    return 0
