"""Tests of the box: a process that exceeds a limit is ended, and this process continues."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from basecal import box
from basecal.errors import InputError

TASKS = """
import sys
from basecal.errors import InputError
def read_frames(words):
    kind = words[0]
    if kind == "arm":
        import time
        try:
            yield [kind, 1.5], b"first"
            time.sleep(60)
        finally:
            open(words[1], "w").write("stopped")
    yield [kind, 1.5], b"first"
    if kind == "memory":
        bytearray(4 * 2**30)
    if kind == "time":
        while True: pass
    if kind == "sleep":
        import time; time.sleep(60)
    if kind == "bytes":
        while True: yield 0, bytes(2**20)
    if kind == "file":
        with open(words[1], "wb") as file:
            while True: file.write(bytes(2**24))
    if kind == "refuse":
        raise InputError("is no such file")
    if kind == "fault":
        raise ZeroDivisionError("by what it holds")
    if kind == "own fault":
        from basecal.errors import list_names
        list_names(None)
    if kind == "crash":
        import os; os.abort()
    print("noise")
"""


@pytest.fixture(autouse=True)
def tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Create a module that misbehaves as requested, with small limits."""
    (tmp_path / "boxed_tasks.py").write_text(TASKS)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(box, "_LEAST_LIMIT_S", 1)
    monkeypatch.setattr(box, "_LEAST_OUTPUT_BYTES", 2**26)


def test_frames_pass_unchanged() -> None:
    """Plain data and bytes pass unchanged; printed text does not disturb them."""
    assert list(box.frames("boxed_tasks", ["good"], 0)) == [(["good", 1.5], b"first")]


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("memory", "needs more memory"),
        ("time", "takes more than 1 s"),
        ("bytes", "gives more than 64 MB"),
        ("file", "File too large"),
        ("refuse", "^is no such file$"),
        ("fault", "ZeroDivisionError by what it holds"),
        ("crash", "ends the process that reads it"),
    ],
)
def test_process_beyond_a_limit_is_ended(tmp_path: Path, kind: str, message: str) -> None:
    """Memory, time, sent bytes and written bytes are limited, and a crash is reported."""
    found = box.frames("boxed_tasks", [kind, str(tmp_path / "out")], 0)
    assert next(found) == ([kind, 1.5], b"first")
    with pytest.raises(InputError, match=message):
        list(found)


def test_internal_fault_is_not_blamed_on_the_file() -> None:
    """An internal fault has the traceback from the box, and is no error of the input."""
    with pytest.raises(box.BoxFault, match=r"^TypeError object of type 'NoneType'") as found:
        list(box.frames("boxed_tasks", ["own fault"], 0))
    assert not isinstance(found.value, InputError)
    assert "in list_names" in found.value.__notes__[0]


def raised(text: str, module: str) -> Exception:
    """What a text raises as a line of a module."""
    with pytest.raises(Exception) as found:  # noqa: PT011
        exec(textwrap.dedent(text), {"__name__": module})
    return found.value


@pytest.mark.parametrize(
    ("text", "module", "is_own"),
    [
        ("{}['x']", "basecal.exchange.bags", True),
        ("import json; json.loads(3)", "basecal.exchange.bags", True),
        ("{}['x']", "rosbags.reader", False),
        ("import json; json.loads(3)", "rosbags.reader", False),
        ("import sqlite3; sqlite3.connect(':memory:').execute('x')", "basecal.exchange.bags", False),
        ("open('/no/such')", "basecal.exchange.bags", False),
        ("from basecal.errors import InputError; raise InputError('x')", "basecal.exchange.bags", False),
    ],
)
def test_fault_is_assigned_by_the_raising_line(text: str, module: str, is_own: bool) -> None:
    """The raising line decides, except for lines of Python's own modules; so does the type of the error."""
    error = raised(text, module)
    error.__traceback__ = error.__traceback__.tb_next if error.__traceback__ else None  # without this test's line
    assert box.is_own_fault(error) is is_own


def test_silent_process_is_ended() -> None:
    """The process is ended long before the limit of CPU time, which waiting does not use."""
    found = box.frames("boxed_tasks", ["sleep"], 10**9, silence_s=1.5)
    assert next(found) == (["sleep", 1.5], b"first")
    with pytest.raises(box.BoxError, match=r"gave no answer within 1\.5 s"):
        next(found)


def processes(word: Path) -> bytes:
    """Process ids of processes whose command line holds a word."""
    return subprocess.run(["pgrep", "-f", str(word)], capture_output=True, check=False).stdout


def test_closed_generator_ends_the_process(tmp_path: Path) -> None:
    """A closed generator leaves no process."""
    found = box.frames("boxed_tasks", ["time", str(tmp_path)], 0)
    next(found)
    found.close()
    assert not processes(tmp_path)


def test_ctrl_c_ends_the_process(tmp_path: Path) -> None:
    """Ctrl-C ends the caller within two seconds, and the process in the box, too."""
    words = f"""
        import signal
        from basecal import box
        signal.signal(signal.SIGINT, signal.default_int_handler)
        found = box.frames("boxed_tasks", ["time", "{tmp_path}"], 10**9)
        print(next(found), flush=True)
        next(found)
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *filter(None, sys.path)])}
    command = [sys.executable, "-c", textwrap.dedent(words)]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        process.stdout.readline()
        began_s = time.monotonic()
        process.send_signal(signal.SIGINT)
        process.wait(10)
        assert time.monotonic() - began_s < 2
    assert not processes(tmp_path)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("number", ["SIGKILL", "SIGTERM"])
def test_process_stops_the_arm_if_the_parent_is_killed(tmp_path: Path, number: str) -> None:
    """The process notices the end of its parent, since nobody is left to interrupt it."""
    stopped, source = tmp_path / "stopped", str(Path(box.__file__).parents[1])
    text = (
        f"from basecal import box\nfor _ in box.frames('boxed_tasks', ['arm', {str(stopped)!r}], 0): print(flush=True)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join((str(tmp_path), source))}
    parent = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, env=environment)
    assert parent.stdout is not None
    parent.stdout.readline()
    parent.send_signal(getattr(signal, number))
    parent.communicate()
    until = time.monotonic() + 10
    while not stopped.exists() and time.monotonic() < until:
        time.sleep(0.02)
    assert stopped.exists()


def test_silent_process_is_interrupted_before_it_is_killed(tmp_path: Path) -> None:
    """The interrupt lets it stop the arm that it moves."""
    stopped = tmp_path / "stopped"
    with pytest.raises(InputError, match=r"gave no answer within 3 s"):
        list(box.frames("boxed_tasks", ["arm", str(stopped)], 0, ending_s=5.0, silence_s=3.0))
    assert stopped.exists()
