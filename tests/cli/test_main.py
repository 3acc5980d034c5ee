"""Tests of the command line's errors, interrupts and exit codes."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from basecal.__main__ import run
from basecal.cli import main


def test_internal_error_is_one_line_and_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A foreign exception causes exit code 70, and the line names the file of its traceback."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("basecal.cell.files.read_cell", lambda folder: 1 / 0)
    assert main(["calibrate", "x"]) == 70
    said = capsys.readouterr()
    (written,) = tmp_path.glob("basecal-*.txt")
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert str(written) in said.err
    assert "ZeroDivisionError: division by zero" in said.err
    assert "Traceback (most recent call last):" in written.read_text()


def test_internal_error_without_disk_space_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The line says that no traceback could be written."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    monkeypatch.setattr("basecal.cell.files.read_cell", lambda folder: 1 / 0)
    assert main(["calibrate", "x"]) == 70
    assert "could not be written" in capsys.readouterr().err


def test_interrupt_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C is one line while a verb works, and during its imports."""

    def interrupted(*_args: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("basecal.cell.files.read_cell", interrupted)
    assert main(["calibrate", str(tmp_path)]) == 130
    assert capsys.readouterr().err == "basecal: error: interrupted\n"
    monkeypatch.delitem(sys.modules, "basecal.cli")
    monkeypatch.setattr("os._exit", lambda code: None)  # pytest has threads of its own
    monkeypatch.setattr("gc.freeze", lambda: None)
    monkeypatch.setattr("gc.set_threshold", lambda count: None)
    monkeypatch.setattr("builtins.__import__", interrupted)
    assert run() == 130
    monkeypatch.undo()
    assert capsys.readouterr().err == "basecal: error: interrupted\n"


_IS_SEARCHED = """
import gc, sys

searched = []
gc.callbacks.append(lambda phase, info: searched.append(phase))
import basecal.cli
from basecal.__main__ import run

def main():
    kept = [[] for _ in range(100_000)]  # about as many as what a calibration loads
    print(len(searched), "searches", gc.get_freeze_count(), "frozen")
    return 3

basecal.cli.main = main
searched.clear()
code = run()
print(gc.get_freeze_count() > 1000)
sys.exit(code)
"""


def test_garbage_collection_is_off_during_commands() -> None:
    """Neither imports nor the exit are searched for cycles: a search takes as long as importing NumPy."""
    found = subprocess.run([sys.executable, "-c", _IS_SEARCHED], capture_output=True, text=True, timeout=60)
    assert (found.returncode, found.stdout, found.stderr) == (3, "0 searches 0 frozen\nTrue\n", "")


def _cpu_s(pid: int) -> float:
    """CPU time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


_THREAD_IN_A_LIBRARY = """
import sys, threading, time
import cv2, numpy as np
import basecal.cli
from basecal.__main__ import run

noise = np.random.default_rng(0).integers(0, 255, (1500, 2000), dtype=np.uint8)
png = cv2.imencode(".png", noise)[1]

def decode():
    while True:
        cv2.imdecode(png, 0)

def main():
    threading.Thread(target=decode, daemon=True).start()
    time.sleep(0.3)
    print("answer")
    return 3

basecal.cli.main = main
sys.exit(run())
"""


@pytest.mark.journey
def test_library_thread_does_not_change_the_exit_code() -> None:
    """If a camera's thread decodes an image at exit, answer and exit code are still those of the verb."""
    found = subprocess.run([sys.executable, "-c", _THREAD_IN_A_LIBRARY], capture_output=True, text=True, timeout=60)
    assert (found.returncode, found.stdout, found.stderr) == (3, "answer\n", "")


_THREAD_THAT_DECODES = """
import sys, threading, time
import cv2
import basecal.cell.files
from basecal.__main__ import run
from basecal.vision.decoder import decode

within, read_cell = threading.Event(), basecal.cell.files.read_cell

def decode_forever(*_args):
    within.set()
    time.sleep(60)

def read_beside_it(folder):
    threading.Thread(target=decode, args=(b"image",), daemon=True).start()
    assert within.wait(30)
    return read_cell(folder)

cv2.imdecode = decode_forever
basecal.cell.files.read_cell = read_beside_it
sys.argv[1:] = ["calibrate", *sys.argv[1:]]
sys.exit(run())
"""


@pytest.mark.journey
def test_decoding_thread_hides_no_error_message(tmp_path: Path) -> None:
    """If a camera's thread captures the decoder's output at exit, the reason of the end is still printed."""
    missing = str(tmp_path / "missing")
    program = [sys.executable, "-c", _THREAD_THAT_DECODES, missing]
    found = subprocess.run(program, capture_output=True, text=True, timeout=60)
    assert found.returncode == 3
    assert found.stderr.startswith(f"basecal: error: {missing}")
    assert found.stderr.count("\n") == 1


@pytest.mark.journey
def test_interrupted_process_exits_with_code_130(tmp_path: Path) -> None:
    """It prints one line, and leaves no partial file."""
    words = [sys.executable, "-m", "basecal", "simulate", str(tmp_path / "cell"), "--samples", "100000"]
    process = subprocess.Popen(
        words,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # what runs in the background may ignore it
    )
    while _cpu_s(process.pid) < 1.0:  # of many that it takes; it begins within a tenth, however busy the machine is
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said == "basecal: error: interrupted\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.journey
def test_folder_name_that_is_not_utf_8_is_accepted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The cell is calibrated like any other, and its page shows the printable part of the name."""
    folder = tmp_path / "cell"
    assert main(["simulate", str(folder), "--samples", "6", "--target", "pose"]) == 0
    named = os.fsdecode(os.fsencode(tmp_path) + b"/bad\xff")
    shutil.move(folder, named)
    assert main(["calibrate", named]) in (0, 1)
    (page,) = Path(named).glob("runs/*/report.html")
    assert "bad\ufffd" in page.read_text(encoding="utf-8")


def test_long_quotes_in_messages_are_shortened(capsys: pytest.CaptureFixture[str]) -> None:
    """A word of 20 kB is cut in the middle: the line keeps the problem at its start and the advice at its end."""
    assert main(["calibrate", "x", "--method", "y" * 20_000]) == 2
    said = capsys.readouterr().err
    assert said.startswith("basecal: error: ")
    assert 2000 < len(said) < 2100
