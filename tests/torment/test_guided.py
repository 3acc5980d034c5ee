"""Tests of damage guided by coverage: repeatable choices, covered lines, and the effect of guidance."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from random import Random

import pytest

from basecal.errors import list_names
from torment import guided, record
from torment.guided import Reached, Words
from torment.outcome import TrialFailed


def _drawn(chance: Random) -> list[object]:
    return [chance.random(), chance.choice("abcdef"), chance.randint(0, 10**30), chance.sample(range(99), 3)]


def test_recorded_choices_are_repeatable() -> None:
    """The recorded choices yield the same damage with any seed; half of them yield the same start."""
    first = Words([], 1)
    drawn = _drawn(first)
    assert _drawn(Words(first.taken, 2)) == drawn
    assert _drawn(Words(first.taken[:1], 2))[0] == drawn[0]
    assert _drawn(Words(first.taken[:1], 2)) != drawn
    assert all(0 <= Words([], seed).random() < 1 for seed in range(100))


def test_covered_lines_count_once(tmp_path: Path) -> None:
    """Only lines of readers count."""
    reached, path = Reached(), tmp_path / "a.csv"
    path.write_text("sample,id,u,v\n0,1,10.5,20.5\n")

    def read() -> str:
        from basecal.exchange.streams import read_pixels

        read_pixels(path)
        return "answered"

    came, new = reached.follow(read)
    assert came == "answered"
    assert new > 20
    assert reached.follow(read) == ("answered", 0)
    assert {Path(name).name for name, _ in reached.lines} >= {"streams.py"}
    assert not any("torment" in name for name, _ in reached.lines)
    assert len(reached.lines & reached.possible) < len(reached.possible)


def test_failure_is_reported_with_its_choices(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The failure can be repeated."""

    def fall(chance: Random, folder: Path) -> str:
        raise TrialFailed(f"by {chance.randrange(10)}")

    monkeypatch.setitem(guided.KINDS, "poses", fall)
    came, _ = guided.guided("poses", range(3), Random(0))
    assert came["failed"] == came.total() == 3
    assert "poses: by" in capsys.readouterr().err


@pytest.mark.slow
def test_guidance_covers_more_lines() -> None:
    """It covers more lines than new choices alone, in 1,200 trials of a URDF each, three draws together."""

    def line_count(is_guided: bool) -> int:
        return sum(len(guided.guided("URDF", range(1200), Random(s), is_guided)[1].lines) for s in (1, 2, 3))

    assert line_count(True) > line_count(False)


def test_guided_runs_are_summed(tmp_path: Path) -> None:
    """They are identified by numbers, which two runs do not share."""
    for _ in range(2):
        guided._record("bag", Counter({"refused": 3, "answered": 1}), tmp_path / "a.json")
    (row,) = record.read(tmp_path / "a.json")
    assert (row.what, row.first, row.end, row.came) == ("bag, guided", 0, 8, {"refused": 6, "answered": 2})


def test_fault_of_the_reader_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of a library is a refusal; an error of the project's own lines is a failure."""

    def at_fault(words: list[str]) -> None:
        list_names(None)  # type: ignore[arg-type]

    monkeypatch.setattr(guided, "read_frames", at_fault)
    with pytest.raises(TrialFailed, match="TypeError"):
        guided.read_bag(Random(1), tmp_path)
