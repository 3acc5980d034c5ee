"""Tests of kills and faults at system calls; verbs that fail there are found."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from torment import system_calls, verbs
from torment.outcome import TrialFailed
from torment.system_calls import Site, is_possible
from torment.verbs import VERBS, Verb, files, prepared

pytestmark = pytest.mark.skipif(not is_possible(), reason="needs strace, and leave to hold other processes")


class _Chosen(Random):
    """Random source that chooses a verb and one of its system calls."""

    def __init__(self, *answers: object) -> None:
        super().__init__(0)
        self._answers = list(answers)

    def choice(self, options: object) -> object:
        return self._answers.pop(0)


def test_new_survives_a_kill_at_each_system_call(tmp_path: Path) -> None:
    """Each writing system call of `new` is a site, and after a kill at any of them the same command succeeds."""
    sites = system_calls.sites("new")
    assert [call for call, _ in sites].count("rename") == 1
    for k, site in enumerate(sites):
        (tmp_path / str(k)).mkdir()
        assert system_calls.kill(_Chosen("new", site), tmp_path / str(k)) == "killed"


@pytest.mark.parametrize(
    "verb",
    ["export", *(pytest.param(verb, marks=pytest.mark.slow) for verb in sorted(VERBS.keys() - {"export", "new"}))],
)
def test_verbs_survive_a_kill_at_their_end(verb: str, tmp_path: Path) -> None:
    """The kill is at the last two writing system calls; `python -m torment.system_calls` tries all."""
    for site in system_calls.sites(verb)[-2:]:
        folder = tmp_path / f"{site.call}{site.number}"
        folder.mkdir()
        assert system_calls.kill(_Chosen(verb, site), folder) in ("killed", "no fault")


def test_full_disk_is_reported(tmp_path: Path) -> None:
    """A write without disk space is reported with the file."""
    site = next(site for site in system_calls.sites("new") if site.call == "write")
    assert system_calls.fault(_Chosen("ENOSPC", "new", site), tmp_path) == "refused"


def test_writing_in_place_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A verb that truncates a file before it writes is found."""

    def main(words: list[str]) -> int:
        (tmp_path / "poses.txt").write_text("new")
        return 0

    monkeypatch.setitem(verbs.VERBS, "in place", Verb("pose", lambda folder: ["in place"], lambda folder: True))
    monkeypatch.setattr(system_calls, "main", main)
    prepared("in place", tmp_path / "a")
    with pytest.raises(TrialFailed, match=r"changed \['poses\.txt'\]"):
        system_calls.kill(_Chosen("in place", Site("write", 1)), tmp_path)


def test_every_verb_has_its_start(tmp_path: Path) -> None:
    """The input of each verb exists, and does not yet have its output."""
    for name in ("new", "simulate", "export", "target"):
        assert prepared(name, tmp_path / name)
        assert "cell/cell.yaml" in files(tmp_path / name)
        with pytest.raises((OSError, ValueError)):
            VERBS[name].right(tmp_path / name)
