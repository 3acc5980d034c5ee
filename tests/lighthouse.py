"""Scores by Lighthouse of pages, loaded by a headless desktop browser.

    python -m tests.lighthouse                  a report, a running capture and the viewer of a simulated cell
    python -m tests.lighthouse site/index.html  pages in files, such as the start page of the site after `make docs`

Lighthouse is fetched by npx. Other work on the machine lowers the score of performance. The browser's own benchmark,
printed beside it, was over 1,000 on an idle machine.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any

from basecal.reporting.live.page import serve_page
from basecal.reporting.page import page
from basecal.reporting.viewing.page import ViewPage, serve_view
from basecal.simulation import Scenario
from tests.shared.browser import CHROMIUM
from tests.shared.watched_capture import captured, cell_with_a_board
from tests.situations import solve

LEAST_SCORE = 0.95
CATEGORIES = ("performance", "accessibility", "best-practices")
FIGURES = ("largest-contentful-paint", "total-blocking-time", "cumulative-layout-shift")
CHROMIUM_FLAGS = "--headless --no-sandbox --disable-gpu --disable-background-networking"


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *arguments: Any) -> None:
        """Leave the terminal to the command."""


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """Serve the files of a folder, and yield the address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=folder)) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


def own_pages(stack: ExitStack, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield names and addresses of a report, a running capture and the viewer, served until the stack closes."""
    cell, recording, calibration, details = solve(Scenario(samples=15, robot_noise=(1e-4, 2e-4)))
    (folder / "report.html").write_text(page(cell, recording, calibration, details), encoding="utf-8")
    yield "report", f"{stack.enter_context(served(folder))}/report.html"
    capture_cell = cell_with_a_board()
    yield "live", stack.enter_context(serve_page(captured(capture_cell), capture_cell, print))
    view_page = ViewPage(cell, recording, folder, ("run",), lambda name: calibration)
    yield "view", stack.enter_context(serve_view(view_page))


def score(address: str) -> dict[str, Any]:
    """Run Lighthouse on a page, and return its results."""
    with TemporaryDirectory() as folder:
        result = Path(folder, "result.json")
        command = ["npx", "--yes", "lighthouse@13", address, "--quiet", "--preset=desktop", "--output=json"]
        command += [f"--only-categories={','.join(CATEGORIES)}", f"--output-path={result}"]
        process = subprocess.run(
            [*command, f"--chrome-flags={CHROMIUM_FLAGS}"],
            env={**os.environ, "CHROME_PATH": str(CHROMIUM)},
            capture_output=True,
            text=True,
            check=False,
        )
        if not result.exists():
            sys.exit(f"Lighthouse cannot be had or did not run:\n{process.stderr.strip()}")
        results: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
    return results


def line(name: str, results: dict[str, Any]) -> str:
    """Text of a page's scores out of 100, its figures, and the browser's benchmark."""
    scores = "  ".join(f"{each} {100 * results['categories'][each]['score']:.0f}" for each in CATEGORIES)
    figures = "  ".join(f"{each} {results['audits'][each].get('displayValue', '?')}" for each in FIGURES)
    return f"{name}: {scores}  ({figures}; benchmark {results['environment']['benchmarkIndex']:.0f})"


def main(files: list[str]) -> int:
    """Print a line for each page; return 1 if the performance of one is below LEAST_SCORE."""
    if missing := [file for file in files if not Path(file).is_file()]:
        sys.exit(f"{missing[0]}: no such file; make docs makes those of the documents")
    for program, package in (("npx", "npm"), (CHROMIUM or "chromium", "chromium")):
        if shutil.which(program) is None:
            sys.exit(f"{program} is missing: install it (Debian: apt install {package})")
    is_slow = False
    with TemporaryDirectory() as folder, ExitStack() as stack:
        pages = (
            ((Path(file).name, f"{stack.enter_context(served(Path(file).parent))}/{Path(file).name}") for file in files)
            if files
            else own_pages(stack, Path(folder))
        )
        for name, address in pages:
            results = score(address)
            print(line(name, results), flush=True)
            is_slow |= results["categories"]["performance"]["score"] < LEAST_SCORE
    return int(is_slow)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
