"""Runs as they are named on the command line."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.terminal import quote_path
from basecal.errors import InputError


def find_run(path: Path) -> Path:
    """The folder of a run, given so or as its file; of a cell's folder its latest run.

    Raises:
        InputError: if a cell has none.
    """
    from basecal.cell.files import latest_run

    if not (path / "cell.yaml").is_file():
        return path
    run = latest_run(path)
    if run is None:
        raise InputError(f"{path} has no run yet: basecal calibrate {quote_path(path)}")
    return run
