"""`basecal compare`."""

from __future__ import annotations

from pathlib import Path

from cyclopts import CycloptsError

from basecal.cli.page import find_run
from basecal.cli.terminal import print_json, quote_path, say_next, say_verdict


def compare(*runs: Path, json: bool = False) -> int:
    """Report whether two runs or more agree, and what differs between them.

    Every run is compared with the first: differences of transforms are printed in
    mm and in sigmas. Changed input files and settings are listed. A cell's folder
    represents its latest run. Errors of two runs are assumed independent; runs of
    the same samples differ by less.

    Exit code: 0 if all agree within their covariances, else 1.

    For example:

        basecal compare mycell/runs/20260102T030405Z mycell/runs/20260109T030405Z
        basecal compare mycell backup/mycell --json

    Args:
        runs: Folders of runs or of cells, two or more.
        json: Print one JSON object instead of text.
    """
    from basecal.accuracy.compare import compare as compared
    from basecal.cell.files import read_calibration
    from basecal.reporting.drift_text import comparison_dict, comparison_text

    if len(runs) < 2:
        raise CycloptsError(msg="give two or more runs: basecal compare RUN RUN")
    names = [str(run) for run in runs]
    first, *others = [read_calibration(find_run(run)) for run in runs]
    comparisons = [compared(first, other) for other in others]
    agree = all(each.agree for each in comparisons)
    if json:
        print_json(comparison_dict(names, comparisons))
    else:
        say_verdict(comparison_text(names, comparisons), "good" if agree else "refused")
        last = runs[-1]
        cell = last if (last / "cell.yaml").is_file() else last.parent.parent
        say_next(f"the figures of a run: basecal report {quote_path(cell)}")
    return 0 if agree else 1
