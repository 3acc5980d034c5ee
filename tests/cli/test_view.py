"""Tests of `basecal view`: its refusals, and its server."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.accuracy.stages.solving import screen_conventions
from basecal.cli import main

answers_alone = without_stages(screen_conventions, find_error_at_task)


def test_cell_without_runs_is_refused_with_advice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message says what to do."""
    assert main(["simulate", str(tmp_path / "cell"), "--samples", "8", "--target", "points"]) == 0
    capsys.readouterr()
    assert main(["view", str(tmp_path / "cell")]) == 3
    assert "no run yet: basecal calibrate" in capsys.readouterr().err


@pytest.mark.slow
def test_server_runs_until_interrupted(tmp_path: Path) -> None:
    """The printed address answers; Ctrl-C ends with code 130 and writes no file."""
    cell = tmp_path / "cell"
    assert main(["simulate", str(cell), "--samples", "10", "--target", "points"]) == 0
    main(["calibrate", str(cell)])
    before = sorted(path for path in cell.rglob("*"))
    words = [sys.executable, "-m", "basecal", "view", str(cell)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env={**os.environ}) as process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert urllib.request.urlopen(address, timeout=60).status == 200
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
    assert sorted(path for path in cell.rglob("*")) == before
