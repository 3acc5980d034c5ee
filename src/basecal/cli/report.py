"""`basecal report`."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.calibrate import exit_code, print_calibration
from basecal.cli.next_step import fill_in_commands, next_command
from basecal.cli.option_types import OpensPage
from basecal.cli.page import FILE, find_run, show_page, stored_run, write_page
from basecal.cli.terminal import print_json, progress, say_next
from basecal.fields.typed_length import length_m


def report(
    cell: Path,
    /,
    *,
    tolerance: str | None = None,
    opens_page: OpensPage = False,
    json: bool = False,
    verbose: bool = False,
) -> int:
    """Print the latest calibration in plain text, and write its page.

    Prints the verdict, the requested transforms with their sigma, the
    cross-validation error and what to do. With --verbose it prints all
    transforms, residuals, noise and findings, and lines to paste for URDF and
    ROS 2. The page, report.html beside calibration.json, has the same content
    with figures; it opens in a browser and needs no network.

    Exit code: 0 if the result is good or the tolerance met, 1 if doubtful,
    4 if refused, 5 if the tolerance is missed.

    For example:

        basecal report mycell
        basecal report mycell --open
        basecal report mycell --verbose
        basecal report mycell --tolerance 0.5mm
        basecal report mycell --json

    Args:
        cell: Folder of the cell.
        tolerance: Length with its unit, such as 0.5mm, below which 95 % of position errors must be expected; by default
            the one given to calibrate.
        opens_page: Show the page in a browser.
        json: Print calibration.json instead, with the verdict on the tolerance.
        verbose: Print the whole report.
    """
    from dataclasses import replace

    from basecal.accuracy.task.expected_error import check_tolerance
    from basecal.cell.files import calibration_to_dict, read_calibration, read_calibration_data, read_cell

    described, run = read_cell(cell), find_run(cell)
    calibration = read_calibration(run)
    if tolerance is not None:
        settings = {**calibration.settings, "tolerance_m": length_m(tolerance)}
        calibration = replace(calibration, settings=settings)
    if json and calibration.settings.get("tolerance_m") is None:
        findings = calibration_to_dict(fill_in_commands(calibration, cell))["findings"]
        print_json({**read_calibration_data(run), "findings": findings})
        return exit_code(calibration)
    stored = stored_run(cell, run, described, calibration)
    calibration = replace(calibration, tolerance=check_tolerance(described, calibration, stored.details.errors))
    if json:
        print_json(calibration_to_dict(fill_in_commands(calibration, cell)))
    else:
        print_calibration(described, fill_in_commands(calibration, cell), verbose)
        with progress("writing the page"):
            write_page(described, calibration, stored)
        show_page(run / FILE, opens_page)
        say_next(next_command(described, calibration, cell))
    return exit_code(calibration)
