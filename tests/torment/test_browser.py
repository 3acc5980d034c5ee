"""Tests of the page in a real browser: hostile texts in an answer run no script and load nothing."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
from pathlib import Path
from typing import Any

import pytest

from basecal.cell.files import calibration_from_dict, latest_run, read_cell, read_recording
from basecal.errors import InputError
from basecal.reporting.page import page
from torment.cells import made
from torment.damage import at, places

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--virtual-time-budget=2000"),
)
RUNS = "document.documentElement.setAttribute('data-owned', 1)"
LONGEST_S = 120  # beside other programs


def hostile_words(port: int) -> list[str]:
    """Texts that would run `RUNS`, or contact this port, if a page had them unescaped."""
    asks = f"http://127.0.0.1:{port}/asked"
    return [
        f"<script>{RUNS}</script>",
        f"</script><script>{RUNS}</script>",
        f'"><img src={asks} onerror="{RUNS}">',
        f"'><svg onload='{RUNS}'>",
        f"</style><link rel=stylesheet href={asks}><style>",
        f"javascript:{RUNS}",
        f'"}}];{RUNS};[{{"',
        f"--><iframe src={asks}></iframe><!--",
    ]


def dumped(path: Path, profile: Path) -> str:
    """Elements of a page after its scripts ran."""
    assert CHROMIUM is not None
    words = [CHROMIUM, *FLAGS, f"--user-data-dir={profile}", "--dump-dom", path.as_uri()]
    return subprocess.run(words, capture_output=True, text=True, timeout=LONGEST_S, check=True).stdout


def shown(cell: Any, recording: Any, data: Any, title: str) -> str:
    return page(cell, recording, calibration_from_dict(data), title=title)


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
@pytest.mark.filterwarnings("ignore")
def test_hostile_texts_run_no_script_and_contact_no_host(tmp_path: Path) -> None:
    """Pages with hostile texts in each possible place run no foreign script and contact no other host.

    A page with such a script, and one that contacts the port, are detected: the test can fail.
    """
    folder = made("charuco").folder
    cell = read_cell(folder)
    recording, run = read_recording(folder, cell), latest_run(folder)
    assert run is not None
    data = json.loads((run / "calibration.json").read_text())
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.5)
        pages = []
        for k, words in enumerate(hostile_words(server.getsockname()[1])):
            hostile = json.loads(json.dumps(data))
            for place in [place for place in places(data) if place and isinstance(at(data, place), str)]:
                kept = at(hostile, place)
                at(hostile, place[:-1])[place[-1]] = words
                try:
                    shown(cell, recording, hostile, words)
                except InputError:
                    at(hostile, place[:-1])[place[-1]] = kept
            assert json.dumps(hostile).count(json.dumps(words)) > 5
            pages.append(tmp_path / f"{k}.html")
            pages[-1].write_text(shown(cell, recording, hostile, words), encoding="utf-8")
        for path in pages:
            assert "data-owned" not in dumped(path, tmp_path / "profile").split(">", 2)[1], path.name
        with pytest.raises(TimeoutError):
            server.accept()
        bad = tmp_path / "bad.html"
        asks = f"http://127.0.0.1:{server.getsockname()[1]}/asked"
        bad.write_text(f"<!DOCTYPE html><html><script>{RUNS}</script><img src={asks}></html>")
        words = [CHROMIUM, *FLAGS, f"--user-data-dir={tmp_path / 'other'}", "--dump-dom", bad.as_uri()]
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as browser:
            server.settimeout(LONGEST_S)
            server.accept()[0].close()
            out, _ = browser.communicate(timeout=LONGEST_S)
        assert "data-owned" in out.split(">", 2)[1]
