"""Tests that boxes forked from this process act like newly started ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal import box
from basecal.errors import InputError
from torment.warm import boxes

TASKS = """
import faulthandler, os
from basecal.errors import InputError
def read_frames(words):
    yield [os.getpid(), words], b"first"
    if words[0] == "time":
        while True: pass
    if words[0] == "memory":
        bytearray(4 * 2**30)
    if words[0] == "refuse":
        raise InputError("is no such file")
    if words[0] == "crash":
        faulthandler.disable()
        os.abort()
"""


@pytest.fixture(autouse=True)
def tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Create a module that misbehaves as requested."""
    (tmp_path / "forked_tasks.py").write_text(TASKS)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(box, "_LEAST_LIMIT_S", 1)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("time", "takes more than 1 s"),
        ("memory", "needs more memory"),
        ("refuse", "^is no such file$"),
        ("crash", "ends the process that reads it"),
    ],
)
def test_forked_box_has_limits(kind: str, message: str) -> None:
    """Its frames arrive, then the reason of its end."""
    with boxes():
        found = box.frames("forked_tasks", [kind, "x"], 0)
        (_, words), content = next(found)
        assert (words, content) == ([kind, "x"], b"first")
        with pytest.raises(InputError, match=message):
            list(found)


def test_forked_box_ends_with_its_reader() -> None:
    """It ends after all frames, or as soon as no reader is left."""
    with boxes():
        assert len(list(box.frames("forked_tasks", ["good"], 0))) == 1
        found = box.frames("forked_tasks", ["time"], 10**9)
        (process, _), _ = next(found)
        assert Path(f"/proc/{process}").exists()
        found.close()
    assert not Path(f"/proc/{process}").exists()
