"""Tests of the exclusive lock on a folder."""

from __future__ import annotations

import subprocess
import sys

import pytest

from basecal.cell.format.locking import locked_folder
from basecal.errors import InputError

HOLD = """
import sys
from pathlib import Path
from basecal.cell.format.locking import locked_folder

with locked_folder(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.mark.journey
def test_folder_is_locked_by_one_process(tmp_path):
    """A second process is refused with a message.

    The lock ends when the first process is killed, and when the context ends.
    """
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"held\n"
        refused = pytest.raises(InputError, match=r"is in use by another capture or driver check\. Wait")
        with refused, locked_folder(tmp_path):
            pass
        process.kill()
        process.wait()
    for _ in range(2):
        with locked_folder(tmp_path):
            assert list(tmp_path.iterdir()) == []


def test_missing_folder_is_named(tmp_path):
    """The error for a missing folder names it."""
    with pytest.raises(InputError, match="none cannot be opened: No such file"), locked_folder(tmp_path / "none"):
        pass


def test_locking_is_skipped_without_fcntl(tmp_path, monkeypatch):
    """Windows has no `fcntl`, so no folder is opened or locked."""
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with locked_folder(tmp_path), locked_folder(tmp_path / "none"):
        pass
