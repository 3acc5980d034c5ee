"""Tests of commands in separate processes: at the same time in one cell, and without home, locale or streams."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from shutil import copytree

import pytest

import basecal
from basecal.cell.files import latest_run, read_calibration, read_recording
from torment.cells import made

SOURCES = str(Path(basecal.__file__).parents[1])
LONGEST_S = 120
ALONE = {"PATH": os.environ.get("PATH", ""), "PYTHONPATH": SOURCES, "OPENBLAS_NUM_THREADS": "1"}


def started(words: list[str], **more: object) -> subprocess.Popen[str]:
    settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **more}
    return subprocess.Popen([sys.executable, "-m", "basecal", *words], **settings)  # type: ignore[call-overload, no-any-return]


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    return Path(copytree(made("pose").folder, tmp_path / "cell"))


@pytest.mark.slow
def test_several_commands_at_once(cell: Path) -> None:
    """Three calibrations and two reports at once each end as alone.

    Each run is complete, and no partial file is left.
    """
    before = len(list((cell / "runs").iterdir()))
    verbs = ["calibrate", "calibrate", "report", "calibrate", "report"]
    ended = [(each, *each.communicate(timeout=LONGEST_S)) for each in [started([verb, str(cell)]) for verb in verbs]]
    assert [(each.returncode, err.count("error")) for each, _, err in ended] == [(0, 0)] * 5
    runs = sorted((cell / "runs").iterdir())
    assert len(runs) == before + 3
    assert {read_calibration(run).verdict for run in runs} == {"good"}
    assert latest_run(cell) in runs
    assert not list(cell.rglob("*.part"))


@pytest.mark.slow
def test_two_imports_at_once(tmp_path: Path) -> None:
    """After two imports into one new cell, the recording is the complete one of one import."""
    poses = tmp_path / "poses.txt"
    poses.write_text("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" * 200)
    streams = ["--eye-base-from-flange", str(poses), "--camera-from-target", str(poses)]
    words = ["import", "poses", str(tmp_path / "new"), "--length-unit", "m", *streams]
    ended = [(each.wait(LONGEST_S), each.communicate()[1]) for each in [started(words), started(words)]]
    assert sorted(code for code, _ in ended) in ([0, 0], [0, 3]), ended
    assert len(read_recording(tmp_path / "new").samples) == 200


@pytest.mark.slow
@pytest.mark.parametrize("surroundings", [{}, {"HOME": "/nowhere", "LC_ALL": "C"}, {"PYTHONUTF8": "0", "LANG": "C"}])
def test_commands_run_without_home_and_locale(cell: Path, surroundings: dict[str, str]) -> None:
    """An environment with only a path suffices, also for a folder with a non-ASCII name."""
    named = cell.rename(cell.with_name("Zelle-ä-細胞"))
    done = started(["calibrate", str(named)], env=ALONE | surroundings)
    out, err = done.communicate(timeout=LONGEST_S)
    assert (done.returncode, "error" in err) == (0, False), err
    assert out.startswith("GOOD")


@pytest.mark.slow
@pytest.mark.parametrize("closed", ["<&-", "2>&-", "<&- 2>&-"])
def test_commands_run_with_closed_streams(cell: Path, closed: str) -> None:
    """Without stdin or stderr a calibration ends as with them."""
    line = f'"{sys.executable}" -m basecal calibrate "{cell}" {closed}'
    done = subprocess.run(["bash", "-c", line], stdout=subprocess.PIPE, text=True, timeout=LONGEST_S, check=False)
    assert (done.returncode, done.stdout.startswith("GOOD")) == (0, True)
