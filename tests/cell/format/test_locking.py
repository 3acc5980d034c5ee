"""A folder that one process holds."""

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


def test_a_folder_is_held_by_one_process_until_it_ends(tmp_path):
    """The second is told so; once the first is killed, the folder is free, and its end frees it again."""
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


def test_a_folder_that_is_not_there(tmp_path):
    """It is named."""
    with pytest.raises(InputError, match="none cannot be opened: No such file"), locked_folder(tmp_path / "none"):
        pass


def test_without_locks_of_files_nothing_is_held(tmp_path, monkeypatch):
    """Windows has none, and opens no folder."""
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with locked_folder(tmp_path), locked_folder(tmp_path / "none"):
        pass
