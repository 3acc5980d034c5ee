"""The edge of the command line: what ends a command besides its answer."""

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


def test_a_bug_is_one_line_and_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An exception that is none of ours is exit code 70, and the line says where its traceback is."""
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


def test_a_bug_without_room_for_its_traceback(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is said that nothing could be written, in one line too."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    monkeypatch.setattr("basecal.cell.files.read_cell", lambda folder: 1 / 0)
    assert main(["calibrate", "x"]) == 70
    assert "could not be written" in capsys.readouterr().err


def test_an_interrupt_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while a verb works, and while what it needs is still imported."""

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


def test_a_command_is_not_searched_for_cycles() -> None:
    """Neither while it loads modules nor as it ends: what they make stays, and to search it takes as long as NumPy."""
    found = subprocess.run([sys.executable, "-c", _IS_SEARCHED], capture_output=True, text=True, timeout=60)
    assert (found.returncode, found.stdout, found.stderr) == (3, "0 searches 0 frozen\nTrue\n", "")


def _cpu_s(pid: int) -> float:
    """Time of a process on the processors [s]."""
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


def test_a_thread_within_a_library_leaves_the_exit_code() -> None:
    """A camera's thread decodes an image as the program ends: its answer and exit code are still those of the verb."""
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


def test_a_thread_that_decodes_hides_no_words(tmp_path: Path) -> None:
    """A camera's thread catches what its decoder says as the program ends: why it ended is still said."""
    missing = str(tmp_path / "missing")
    program = [sys.executable, "-c", _THREAD_THAT_DECODES, missing]
    found = subprocess.run(program, capture_output=True, text=True, timeout=60)
    assert found.returncode == 3
    assert found.stderr.startswith(f"basecal: error: {missing}")
    assert found.stderr.count("\n") == 1


@pytest.mark.journey
def test_an_interrupted_process(tmp_path: Path) -> None:
    """It ends with 130 and one line, and leaves nothing half written."""
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


def test_a_folder_whose_name_is_no_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A name that is not UTF-8 is calibrated like any other, and its page shows what can be shown of it."""
    folder = tmp_path / "cell"
    assert main(["simulate", str(folder), "--samples", "6", "--target", "pose"]) == 0
    named = os.fsdecode(os.fsencode(tmp_path) + b"/bad\xff")
    shutil.move(folder, named)
    assert main(["calibrate", named]) in (0, 1)
    (page,) = Path(named).glob("runs/*/report.html")
    assert "bad\ufffd" in page.read_text(encoding="utf-8")


def test_a_message_quotes_no_more_than_fits(capsys: pytest.CaptureFixture[str]) -> None:
    """A word of 20 kB is cut in its middle: the line keeps what is wrong at its start and the advice at its end."""
    assert main(["calibrate", "x", "--method", "y" * 20_000]) == 2
    said = capsys.readouterr().err
    assert said.startswith("basecal: error: ")
    assert 2000 < len(said) < 2100
