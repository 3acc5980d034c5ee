"""`basecal report`."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.calibrate import exit_code, show
from basecal.cli.page import print_page_path, rewrite_page
from basecal.cli.terminal import pasted, print_json
from basecal.errors import InputError


def report(cell: Path, /, *, json: bool = False, verbose: bool = False) -> int:
    """Tell the latest calibration in plain text, and write its page.

    The verdict, what was asked for with its sigma, the cross-validation error
    and what to do. With --verbose all transforms, residuals, noise and findings,
    and lines to paste for URDF and ROS 2. The page, report.html beside
    calibration.json, says the same with figures; it opens in a browser and
    needs no network.

    Ends with 0 where the answer is good, with 1 where it is doubtful or
    refused.

    For example:

        basecal report mycell
        basecal report mycell --verbose
        basecal report mycell --json

    Args:
        cell: Folder of the cell.
        json: Print calibration.json instead.
        verbose: Print all of the report.
    """
    from basecal.cell.files import latest_run, read_calibration, read_calibration_data, read_cell

    described, run = read_cell(cell), latest_run(cell)
    if run is None:
        raise InputError(f"{cell} has no run yet: basecal calibrate {pasted(cell)}")
    calibration = read_calibration(run)
    if json:
        print_json(read_calibration_data(run))
    else:
        show(described, calibration, verbose)
        rewrite_page(cell, run, described, calibration)
        print_page_path(run)
    return exit_code(calibration)
