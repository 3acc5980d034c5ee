"""`basecal view`."""

from __future__ import annotations

from pathlib import Path
from threading import Event

from basecal.cli.detect import detected_recording
from basecal.cli.option_types import Port
from basecal.cli.page import find_run
from basecal.cli.terminal import say


def view(cell: Path, /, *, port: Port = 0) -> int:
    """Look through the runs of a cell on a local page.

    A run is chosen, its samples are looked through one by one, and left out or
    taken again. The new answer is shown at once, beside its difference from the
    run. Nothing is written. The page is served to this machine alone, to whoever
    has the address that is printed; Ctrl-C ends it.

    For example:

        basecal view mycell
        basecal view mycell --port 8080

    Args:
        cell: Folder of the cell.
        port: Where the page is served; any that is free where 0.
    """
    from basecal.cell.files import read_calibration, read_cell, run_folder, run_names
    from basecal.estimation.streams.streams import synchronous
    from basecal.reporting.viewing.page import ViewPage, serve_view

    described = read_cell(cell)
    latest = read_calibration(find_run(cell))
    recording = synchronous(described, detected_recording(cell, described), latest)
    page = ViewPage(described, recording, cell, run_names(cell), lambda name: read_calibration(run_folder(cell, name)))
    with serve_view(page, port) as address:
        say(f"{address}\nopen this in a browser; Ctrl-C ends it")
        Event().wait()
    return 0
