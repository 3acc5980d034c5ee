"""Scores of pages by Lighthouse, as a desktop's browser without a window loads them.

    python -m tests.lighthouse                  a report, a running capture and the viewer of a simulated cell
    python -m tests.lighthouse site/index.html  pages in files, such as the first of the documents after `make docs`

Lighthouse is fetched by npx. Other work on the machine lowers the score of performance: the browser's own benchmark,
beside it, was over 1,000 where nothing else ran.
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
from tests.situations import solved

LEAST = 0.95
CATEGORIES = ("performance", "accessibility", "best-practices")
FIGURES = ("largest-contentful-paint", "total-blocking-time", "cumulative-layout-shift")
CHROMIUM_FLAGS = "--headless --no-sandbox --disable-gpu --disable-background-networking"


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *arguments: Any) -> None:
        """Leave the terminal to the command."""


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """The address of a folder's files while this lasts."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=folder)) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


def own_pages(stack: ExitStack, folder: Path) -> Iterator[tuple[str, str]]:
    """Names and addresses of a report, a running capture and the viewer, which are served by the stack."""
    cell, recording, calibration, details = solved(Scenario(samples=15, robot_noise=(1e-4, 2e-4)))
    (folder / "report.html").write_text(page(cell, recording, calibration, details), encoding="utf-8")
    yield "report", f"{stack.enter_context(served(folder))}/report.html"
    seen = cell_with_a_board()
    yield "live", stack.enter_context(serve_page(captured(seen), seen, print))
    viewed = ViewPage(cell, recording, folder, ("run",), lambda name: calibration)
    yield "view", stack.enter_context(serve_view(viewed))


def score(address: str) -> dict[str, Any]:
    """Lighthouse's scores of a page and what makes them."""
    with TemporaryDirectory() as folder:
        result = Path(folder, "result.json")
        words = ["npx", "--yes", "lighthouse@13", address, "--quiet", "--preset=desktop", "--output=json"]
        words += [f"--only-categories={','.join(CATEGORIES)}", f"--output-path={result}"]
        made = subprocess.run(
            [*words, f"--chrome-flags={CHROMIUM_FLAGS}"],
            env={**os.environ, "CHROME_PATH": str(CHROMIUM)},
            capture_output=True,
            text=True,
            check=False,
        )
        if not result.exists():
            sys.exit(f"Lighthouse cannot be had or did not run:\n{made.stderr.strip()}")
        found: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
    return found


def line(name: str, found: dict[str, Any]) -> str:
    """A page's scores of 100, its figures, and the browser's benchmark."""
    scores = "  ".join(f"{each} {100 * found['categories'][each]['score']:.0f}" for each in CATEGORIES)
    figures = "  ".join(f"{each} {found['audits'][each].get('displayValue', '?')}" for each in FIGURES)
    return f"{name}: {scores}  ({figures}; benchmark {found['environment']['benchmarkIndex']:.0f})"


def main(files: list[str]) -> int:
    """Print a line for each page; 1 if one of them is slower than asked."""
    if missing := [file for file in files if not Path(file).is_file()]:
        sys.exit(f"{missing[0]}: no such file; make docs makes those of the documents")
    for program, package in (("npx", "npm"), (CHROMIUM or "chromium", "chromium")):
        if shutil.which(program) is None:
            sys.exit(f"{program} is missing: install it (Debian: apt install {package})")
    slow = False
    with TemporaryDirectory() as folder, ExitStack() as stack:
        named = (
            ((Path(file).name, f"{stack.enter_context(served(Path(file).parent))}/{Path(file).name}") for file in files)
            if files
            else own_pages(stack, Path(folder))
        )
        for name, address in named:
            found = score(address)
            print(line(name, found), flush=True)
            slow |= found["categories"]["performance"]["score"] < LEAST
    return int(slow)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
