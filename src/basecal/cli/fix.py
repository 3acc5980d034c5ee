"""`basecal fix`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.calibrate import calibrate_folder, exit_code, print_result, recalibrate_folder
from basecal.cli.detect import detected_recording
from basecal.cli.next_step import fill_in_commands, next_command
from basecal.cli.terminal import ask, quote_path, say, say_next
from basecal.errors import UsageError

if TYPE_CHECKING:
    from basecal.accuracy.fixing.cures import Cure
    from basecal.cell import Calibration, Cell


def fix(cell: Path, /, *, choose: int | None = None, yes: bool = False) -> int:
    """Fix faults that the latest calibration found in the files of the cell, and calibrate again.

    Shows the changes and asks for confirmation. Recorded poses are inverted,
    converted, reordered or paired again. Sizes of targets are corrected, lenses
    and transforms freed, samples left out, and suggested lines written. The
    original files and a record of the changes are kept in CELL/originals.
    Settings and tolerance are those of the latest calibration. Exit codes are
    those of calibrate, but 1 if no fix is known.

    For example:

        basecal fix mycell
        basecal fix mycell --yes
        basecal fix mycell --choose 2 --yes

    Args:
        cell: Folder of the cell.
        choose: Number of the fix; by default the first. Required if several fit the data equally.
        yes: Apply the fix without a question.
    """
    from basecal.accuracy.fixing.apply import apply_cure, describe_change
    from basecal.accuracy.fixing.cures import find_cures
    from basecal.cell.files import read_cell, read_recording

    described = read_cell(cell)
    calibration = _latest_calibration(cell, described)
    recording, detections = read_recording(cell, described), detected_recording(cell, described, is_forced=True)
    cures = find_cures(described, recording, detections, calibration)
    if not cures:
        return _say_no_cure(described, fill_in_commands(calibration, cell), cell)
    cure = _chosen_cure(cures, choose)
    for line in describe_change(recording, cure.change):
        say(f"  {line}")
    question = f"Apply this fix to {cell}?"
    if not yes:
        ask(question, f"{question} Add --yes to apply it: nobody can be asked here", "nothing is changed")
    backup = apply_cure(cell, cure)
    say(f"fixed; the original files are in {backup}")
    fixed_cell = read_cell(cell)
    result = recalibrate_folder(cell, fixed_cell, calibration)
    print_result(result, fixed_cell, cell)
    return exit_code(result.calibration)


def _say_no_cure(cell: Cell, calibration: Calibration, folder: Path) -> int:
    """Report that there is nothing to fix or that no fix is known, and return the exit code."""
    from basecal.reporting.statement.verdict import calibrate_command, headline

    grave = [finding for finding in calibration.findings if finding.severity != "info"]
    if grave:
        say(f"no fix is known: {grave[0].message}")
        say_next(f"follow the advice above, then {calibrate_command(cell, calibration, quote_path(folder))}")
        return 1
    say(f"nothing to fix: {headline(cell, calibration)}")
    say_next(next_command(cell, calibration, folder))
    return exit_code(calibration)


def _latest_calibration(folder: Path, cell: Cell) -> Calibration:
    """The calibration of the current files; if the latest is outdated, calibrate again with its settings."""
    from basecal.cell.files import input_hashes, latest_run, read_calibration

    run = latest_run(folder)
    if run is not None:
        latest = read_calibration(run / "calibration.json")
        is_current = latest.inputs == input_hashes(folder, cell)
        return latest if is_current else recalibrate_folder(folder, cell, latest).calibration
    return calibrate_folder(folder, cell).calibration


def _chosen_cure(cures: tuple[Cure, ...], choose: int | None) -> Cure:
    """List all cures, and return the one with the chosen number.

    Raises:
        UsageError: if there is no such number, or several cures fit equally and none is chosen.
    """
    for number, cure in enumerate(cures, start=1):
        say(f"{number}. {cure.words} [{cure.finding.code}]")
    if choose is not None and not 1 <= choose <= len(cures):
        raise UsageError(f"--choose {choose}: there are fixes 1 to {len(cures)}")
    if choose is None and cures[0].is_choice:
        equal = [f"--choose {n}" for n, cure in enumerate(cures, start=1) if cure.finding is cures[0].finding]
        raise UsageError(f"these fit the data equally: check which is true, and add {' or '.join(equal)}")
    return cures[(choose or 1) - 1]
