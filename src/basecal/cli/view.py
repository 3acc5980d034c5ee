"""`basecal view`."""

from __future__ import annotations

from pathlib import Path
from threading import Event

from basecal.cli.detect import detected_recording
from basecal.cli.option_types import Port
from basecal.cli.page import find_run
from basecal.cli.terminal import say


def view(cell: Path, /, *, port: Port = 0) -> int:
    """Show the runs of a cell on a local page.

    On the page you choose a run, look at its samples, and exclude or include
    them. The new result is shown at once, with its difference from the run. No
    files are written. The page is served only to this machine, at the printed
    address, which contains a token; Ctrl-C ends it.

    For example:

        basecal view mycell
        basecal view mycell --port 8080

    Args:
        cell: Folder of the cell.
        port: Port of the page; 0 selects a free one.
    """
    from basecal.cell.files import read_calibration, read_cell, run_folder, run_names
    from basecal.estimation.streams.streams import synchronous_recording
    from basecal.reporting.viewing.page import ViewPage, serve_view

    described = read_cell(cell)
    latest = read_calibration(find_run(cell))
    recording = synchronous_recording(described, detected_recording(cell, described), latest)
    page = ViewPage(described, recording, cell, run_names(cell), lambda name: read_calibration(run_folder(cell, name)))
    with serve_view(page, port) as address:
        say(f"{address}\nopen this in a browser; Ctrl-C ends it")
        Event().wait()
    return 0
