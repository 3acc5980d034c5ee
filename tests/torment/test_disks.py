"""Tests of slow and read-only disks; verbs that fail there are found."""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

import pytest

from torment import disks, verbs
from torment.outcome import TrialFailed
from torment.verbs import Verb, prepared


class _Chosen(Random):
    """Random source that chooses a verb, and otherwise the first entry."""

    def __init__(self, verb: str) -> None:
        super().__init__(0)
        self._verb = verb

    def choice(self, options: object) -> object:
        known = list(options)  # type: ignore[call-overload]
        return self._verb if self._verb in known else known[0]


@pytest.mark.skipif(not disks.system_calls.is_possible(), reason="needs strace, and leave to hold other processes")
def test_slow_disk_does_not_change_the_result(tmp_path: Path) -> None:
    """A verb whose calls take a millisecond longer succeeds, whether it is killed meanwhile or not."""
    for seed in range(2):
        (tmp_path / str(seed)).mkdir()
        chance = _Chosen("new")
        chance.seed(seed)
        assert disks.slow_disk(chance, tmp_path / str(seed)) in ("answered", "killed")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs Linux's capabilities")
def test_read_only_disk_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A verb reports it in one line, even as root; a verb that does not is found."""
    assert disks.read_only(_Chosen("new"), tmp_path / "a") == "refused"
    silent = Verb("pose", lambda folder: ["new", str(folder / "new")], lambda folder: True)
    monkeypatch.setitem(verbs.VERBS, "silent", silent)
    prepared("silent", tmp_path / "b")
    monkeypatch.setattr(disks, "main", lambda words: 70)
    with pytest.raises(TrialFailed, match="where nothing may be written: exit code 70"):
        disks.read_only(_Chosen("silent"), tmp_path / "c")
