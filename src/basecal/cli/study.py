"""`basecal study`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from basecal.cli.option_types import Output, number_range
from basecal.cli.terminal import print_json, progress, progress_bar, say
from basecal.errors import UsageError

if TYPE_CHECKING:
    from basecal.cell import Calibration, Cell, Recording
    from basecal.studies.jobs import WorkerPool
    from basecal.studies.study import Study

Workers = Annotated[int | None, number_range(1, 1024)]


def study(
    file: Path | None = None,
    /,
    *,
    cells: Path | None = None,
    workers: Workers = None,
    scheduler: str | None = None,
    output: Output = None,
    json: bool = False,
) -> int:
    """Simulate and calibrate many cells in a study, or calibrate a folder of cells.

    FILE states what is varied, what is constant and the number of trials
    (docs/studies.md), such as boards and numbers of samples. Writes a table of
    all trials, a summary and a page. With --cells instead, each cell below a
    folder is calibrated; the table has a row for each, even if it fails. The same
    command continues an interrupted study. The results do not depend on the
    number of workers.

    For example:

        basecal study examples/studies/which_board.yaml
        basecal study which_board.yaml --workers 8 -o results --json
        basecal study which_board.yaml --scheduler tcp://10.0.0.1:8786
        basecal study --cells all_cells -o calibrated
        basecal study paper -o paper

    Args:
        file: File of the study.
        cells: Folder with cells to calibrate, at any depth.
        workers: Number of processes; by default the number of cores.
        scheduler: Address of a Dask scheduler whose workers are used instead; needs the extra `cluster`.
        output: Folder of the results; by default FILE's name without its ending, or the name of the folder of cells
            with `_calibrated`.
        json: Print the summary as JSON.
    """
    from basecal.studies.jobs import WorkerPool
    from basecal.studies.study_file import read_study

    if scheduler is not None and workers is not None:
        raise UsageError("--workers are processes of this machine, --scheduler has its own: give only one of them")
    pool = WorkerPool(workers or os.cpu_count() or 1, scheduler)
    if (file is None) == (cells is None):
        raise UsageError("give the file of a study, or --cells with a folder of cells: one of them")
    if file is not None:
        summary = execute_study(read_study(file), Path(file.stem) if output is None else output, pool)
    else:
        summary = _execute_fleet(cells or Path(), output, pool)
    if json:
        print_json({name: value for name, value in summary.items() if name != "words"})
    else:
        say(summary_text(summary))
    return 0


def summary_text(summary: dict[str, Any]) -> str:
    """A summary as text, with the paths of its files."""
    return f"{summary['words']}\ntable: {summary['table']}\npage: {summary['page']}"


def execute_study(study: Study, folder: Path, workers: WorkerPool) -> dict[str, Any]:
    """Run a study, write its results, and return its summary with its text."""
    from basecal.reporting.sweep.page import sweep_page, sweep_text
    from basecal.studies.run import run_study
    from basecal.studies.summary import summarise, write_table

    with progress_bar("trying") as step:
        run_study(study, folder, workers, step)
    with progress("writing"):
        table, summary = write_table(study, folder), summarise(study, folder)
        paths = _write_results(summary, table, sweep_page(summary, study.text))
    return {**summary, "folder": str(folder), **paths, "words": sweep_text(summary)}


def _execute_fleet(cells: Path, output: Path | None, workers: WorkerPool) -> dict[str, Any]:
    """Calibrate a folder of cells, write the results, and return their summary with its text."""
    from basecal.reporting.fleet.page import fleet_page, fleet_text
    from basecal.studies.fleet.run import make_fleet, run_fleet
    from basecal.studies.fleet.summary import fleet_rows, summarise_fleet, write_fleet_table

    fleet = make_fleet(cells, Path(f"{cells.resolve().name}_calibrated") if output is None else output)
    with progress_bar("calibrating") as step:
        run_fleet(fleet, workers, step, cell_page)
    with progress("writing"):
        rows = fleet_rows(fleet)
        table, summary = write_fleet_table(rows, fleet.output), summarise_fleet(fleet, rows)
        paths = _write_results(summary, table, fleet_page(summary, rows))
    return {**summary, **paths, "words": fleet_text(summary, rows)}


def cell_page(cell: Cell, recording: Recording, calibration: Calibration, title: str) -> str:
    """The page of a cell of a fleet, as from `basecal calibrate`."""
    from basecal.accuracy.fit_details import fit_details
    from basecal.cli.page import add_stored_scene
    from basecal.estimation.streams.streams import synchronous_recording
    from basecal.reporting.page import page

    shown = add_stored_scene(cell, synchronous_recording(cell, recording, calibration), calibration, calibration.scene)
    return page(*shown, calibration, fit_details(*shown, calibration), title=title)


def _write_results(summary: dict[str, Any], table: Path, page: str) -> dict[str, str]:
    """Write the page and the summary beside the table, and return the paths of table and page."""
    import json

    from basecal.cell.format.writing import write_atomically

    folder = table.parent
    write_atomically(folder / "summary.json", json.dumps(summary, indent=1, allow_nan=False) + "\n", base_folder=folder)
    write_atomically(folder / "report.html", page, base_folder=folder)
    return {"table": str(table), "page": str(folder / "report.html")}
