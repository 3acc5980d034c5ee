"""`basecal study`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter, validators

from basecal.cli.detected import counting
from basecal.cli.terminal import print_json, progress, say

if TYPE_CHECKING:
    from basecal.studies.study import Study

Workers = Annotated[int | None, Parameter(validator=validators.Number(gte=1, lte=1024))]
Output = Annotated[Path | None, Parameter(name=["--output", "-o"])]


def study(file: Path, /, *, workers: Workers = None, output: Output = None, json: bool = False) -> int:
    """Try calibrations out, thousands of times: which board, how many samples.

    FILE says what is varied, what is held and how often it is tried
    (docs/studies.md). Writes a table of all trials, a summary and a page to
    look at. What is done is kept: started again after it was cut off, the
    study goes on where it was. The numbers depend on FILE alone, not on how
    many processes work on it.

    For example:

        basecal study examples/studies/which_board.yaml
        basecal study which_board.yaml --workers 8 -o results --json
        basecal study paper

    Args:
        file: The study.
        workers: How many processes; as many as the machine has cores where none is given.
        output: Folder for what comes out; FILE's name without its ending where none is given.
        json: Print the summary as JSON.
    """
    from basecal.studies.run import run_study
    from basecal.studies.study_file import read_study

    asked = read_study(file)
    folder = Path(file.stem) if output is None else output
    with counting("trying") as step:
        run_study(asked, folder, min(workers or os.cpu_count() or 1, len(asked.chunks)), step)
    with progress("writing"):
        summary = _written(asked, folder)
    if json:
        print_json(summary)
    else:
        from basecal.reporting.sweep.text import sweep_text

        say(sweep_text(summary))
        say(f"table: {summary['table']}\npage: {summary['page']}")
    return 0


def _written(asked: Study, folder: Path) -> dict[str, Any]:
    """The summary, after it, the table and the page are written."""
    import json

    from basecal.cell.format.writing import write_whole
    from basecal.reporting.sweep.page import sweep_page
    from basecal.studies.summary import summarise
    from basecal.studies.table import write_table

    paths = {"folder": str(folder), "table": str(write_table(asked, folder)), "page": str(folder / "report.html")}
    summary = summarise(asked, folder)
    write_whole(folder / "summary.json", json.dumps(summary, indent=1, allow_nan=False) + "\n", within=folder)
    write_whole(folder / "report.html", sweep_page(summary, asked.text), within=folder)
    return {**summary, **paths}
