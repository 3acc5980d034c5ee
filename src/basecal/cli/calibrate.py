"""`basecal calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.terminal import print_json, progress

if TYPE_CHECKING:
    from basecal.cell import Calibration, Cell


def calibrate(cell: Path, /, *, json: bool = False) -> int:
    """Find the transforms asked for, with their covariance.

    Reads CELL/cell.yaml and CELL/recording/samples.jsonl, writes the answer
    and its report to CELL/runs. Ends with 0 where the answer is good, with 1
    where it is doubtful or refused.

    For example:

        basecal calibrate mycell
        basecal calibrate mycell --json > answer.json

    Args:
        cell: Folder of the cell.
        json: Print calibration.json instead of the report.
    """
    from basecal.cell.files import calibration_to_dict, read_cell

    described = read_cell(cell)
    calibration = calibrate_folder(cell, described)
    if json:
        print_json(calibration_to_dict(calibration))
    else:
        show(described, calibration)
    return exit_code(calibration)


def calibrate_folder(folder: Path, cell: Cell) -> Calibration:
    """Calibrate the recording of a cell's folder, and write the run beside it."""
    from dataclasses import replace

    from basecal.accuracy.verdict import calibrate as calibrated
    from basecal.cell.files import input_hashes, read_recording, write_calibration
    from basecal.reporting.text import text_report

    with progress("calibrating"):
        calibration = calibrated(cell, read_recording(folder, cell))
    calibration = replace(calibration, inputs=input_hashes(folder, cell))
    path = write_calibration(calibration, folder)
    path.with_name("report.txt").write_text(text_report(cell, calibration) + "\n", encoding="utf-8")
    return calibration


def show(cell: Cell, calibration: Calibration) -> None:
    """Print the report."""
    from basecal.reporting.text import text_report

    print(text_report(cell, calibration))


def exit_code(calibration: Calibration) -> int:
    """0 where the verdict is good, else 1."""
    return 0 if calibration.verdict == "good" else 1
