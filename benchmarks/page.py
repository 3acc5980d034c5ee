"""Reports and the viewer in headless Chromium: their size, and the time until they can be used.

This is the time from the start of loading until all is loaded and the scripts of the page answer, with an empty cache.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.shared.browser import CHROMIUM, Visit, visit
from tests.shared.real_recordings import EXAMPLES, data_folder

from basecal.accuracy.calibrate import calibrate
from basecal.cell.files import latest_run, read_cell, read_recording
from basecal.reporting.viewing.page import ViewPage, serve_view
from benchmarks.common import table, write

MOST_S, MOST_BYTES = 2.0, 3_000_000
VISITS = 3
VIEWER = "viewer of ur5e_dual"


@dataclass(frozen=True)
class Page:
    """The folder of a cell, and further arguments of its calibration."""

    cell: Path
    words: tuple[str, ...] = ()


def pages() -> dict[str, Page]:
    """Pages by name; those of published recordings if they are at hand."""
    every_page = {
        "ur5e_dual": Page(EXAMPLES / "ur5e_dual"),
        "ur5e_dual with a box": Page(
            EXAMPLES / "ur5e_dual", ("--task-box", "0.6", "-0.2", "0.1", "1.0", "0.2", "0.5", "--certify")
        ),
        "ur5e_images": Page(EXAMPLES / "ur5e_images"),
        "kuka_1_chessboard": Page(data_folder() / "kuka_1_chessboard"),
        "motoman_dual_joints": Page(data_folder() / "motoman_dual_joints"),
    }
    return {name: page for name, page in every_page.items() if (page.cell / "cell.yaml").exists()}


def _visits(address: str, folder: Path, selector: str) -> list[Visit]:
    return [visit(address, folder / f"profile{k}", selector) for k in range(VISITS)]


def _row(name: str, count: int | None, visits: list[Visit]) -> dict[str, Any]:
    times = sorted(each.answers_s for each in visits if each.answers_s is not None)
    return {
        "page": name,
        "bytes": count,
        "seconds": times[len(times) // 2] if len(times) == len(visits) else None,
        "errors": sum(len(each.errors) for each in visits),
    }


def measure_report(name: str, page: Page) -> dict[str, Any]:
    """Measure the page that `basecal calibrate` writes."""
    with TemporaryDirectory() as folder:
        cell = Path(folder) / "cell"
        shutil.copytree(page.cell, cell, ignore=shutil.ignore_patterns("runs", "derived"))
        words = [sys.executable, "-m", "basecal", "calibrate", str(cell), *page.words]
        subprocess.run(words, check=False, capture_output=True)
        run = latest_run(cell)
        assert run is not None, f"basecal calibrate {cell} wrote no run"
        written = run / "report.html"
        return _row(name, written.stat().st_size, _visits(written.as_uri(), Path(folder), "footer, main, svg"))


def measure_viewer() -> dict[str, Any]:
    """Measure the page that `basecal view` serves."""
    folder = EXAMPLES / "ur5e_dual"
    cell = read_cell(folder)
    recording = read_recording(folder, cell)
    calibration = calibrate(cell, recording)
    view_page = ViewPage(cell, recording, folder, ("20260102T030405Z",), lambda name: calibration)
    with TemporaryDirectory() as profiles, serve_view(view_page) as address:
        return _row(VIEWER, None, _visits(address, Path(profiles), "[data-part=answer] table"))


def measure(names: list[str]) -> Iterator[dict[str, Any]]:
    """Rows of pages by name, the last of the viewer."""
    pages_by_name = pages()
    for name in names:
        if name != VIEWER:
            yield measure_report(name, pages_by_name[name])
    if VIEWER in names:
        yield measure_viewer()


HEAD = ("page", "MB", "s", "console errors", "holds")


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    size = "" if result["bytes"] is None else f"{result['bytes'] / 1e6:.2f}"
    holds = result["seconds"] is not None and result["seconds"] <= MOST_S and not result["errors"]
    holds = holds and (result["bytes"] or 0) <= MOST_BYTES
    took = "never" if result["seconds"] is None else f"{result['seconds']:.2f}"
    return result["page"], size, took, str(result["errors"]), "yes" if holds else "NO"


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
Pages in headless Chromium with an empty cache. The time is from the start of loading until the page is complete and its
scripts answer, the median of {VISITS}. Required: at most {MOST_S:g} s and {MOST_BYTES / 1e6:g} MB, and no error in the
console."""
    return f"{about}\n\n{table(HEAD, map(row, result['rows']))}"


def main(arguments: list[str]) -> None:
    """Measure and print; if all were measured, write results/page.json too."""
    names = [*pages(), VIEWER]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.page", description=__doc__)
    parser.add_argument("--pages", nargs="*", default=names, choices=names, metavar="NAME")
    asked = parser.parse_args(arguments)
    if CHROMIUM is None:
        sys.exit("Chromium is not installed: apt-get install chromium")
    rows = list(measure(asked.pages))
    print(table(HEAD, map(row, rows)))
    if asked.pages == names and (data_folder() / "kuka_1_chessboard").exists():
        write("page", {"rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
