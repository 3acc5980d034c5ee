"""Tests of the counts of many runs, which are summed without counting a seed twice."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from torment import record, run
from torment.record import Row, added, next_seed, page, read, summed, write


def test_runs_are_summed(tmp_path: Path) -> None:
    """A run that continues another of its commit is joined to it; another commit has its own row."""
    path, rows = tmp_path / "torment.json", []
    rows = added(rows, Row("poses", "a1", 10, 15, {"answered": 2, "refused": 3}))
    rows = added(rows, Row("poses", "a1", 15, 16, {"failed": 1}, {"failed": {"15": "why"}}))
    rows = added(rows, Row("poses", "b2", 16, 18, {"refused": 2}))
    write(rows, path)
    assert (
        read(path)
        == rows
        == [
            Row("poses", "a1", 10, 16, {"answered": 2, "refused": 3, "failed": 1}, {"failed": {"15": "why"}}),
            Row("poses", "b2", 16, 18, {"refused": 2}),
        ]
    )
    assert (next_seed(rows, "poses"), next_seed(rows, "poses", 100), next_seed(rows, "URDF", 7)) == (18, 100, 7)
    assert "| poses | 8 | 2 | 5 |  | 1 | a1, b2 |" in summed(rows)


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([Row("poses", "a", 0, 3, {"refused": 3}), Row("poses", "b", 2, 4, {"refused": 2})], "counted twice"),
        ([Row("poses", "a", 0, 3, {"refused": 4})], "4 trials up to 3"),
    ],
)
def test_no_seed_counts_twice(rows: list[Row], reason: str, tmp_path: Path) -> None:
    """Rows with shared seeds or wrong counts are errors."""
    write(rows, tmp_path / "torment.json")
    with pytest.raises(ValueError, match=reason):
        read(tmp_path / "torment.json")


def test_recorded_seeds_continue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two consecutive runs try different seeds."""
    seen: list[int] = []
    monkeypatch.setattr(run, "tried", lambda name, seed: seen.append(seed) or "refused")
    monkeypatch.setitem(run._RECORDED_AT_ONCE, "poses", 3)
    for _ in range(2):
        next(run.recorded(["poses"], 9.0, tmp_path / "torment.json"))
    assert len(seen) == len(set(seen)) == 6
    assert read(tmp_path / "torment.json")[0].came == {"refused": 6}


def test_page_has_the_recorded_counts() -> None:
    """docs/reliability.md equals benchmarks/results/torment.json: `python -m torment.record` writes it."""
    assert page(record.PAGE.read_text(), read()) == record.PAGE.read_text()


def test_promises_have_the_recorded_counts() -> None:
    """SECURITY.md equals benchmarks/results/torment.json: `python -m torment.record` writes it."""
    text = record.PROMISES.read_text()
    assert record.promises(text, read(), record.trial_modules()) == text


def test_promise_counts_the_seeds_of_its_trials() -> None:
    """The seeds are those of the named modules, of a single kind, or cases of tests; untried kinds are named."""
    modules = {"poses": "readers", "URDF": "readers", "page": "trials", "view": "others"}
    tried = Counter({"poses": 1500, "URDF": 20, "page": 3})
    for trial, expected in (
        ("`tests/torment/readers.py`", "1,520 of 2 kinds, at least 20 each"),
        ("`tests/torment/others.py`, `tests/test_box.py`", "0"),
        ("`page` of `tests/torment/trials.py`", "3"),
        ("`tests/torment/outcome.py`, every command", "1,523 of 3 kinds, at least 3 each; not yet tried: view"),
        ("`tests/test_box.py`", "tests"),
    ):
        assert record._seeds(trial, tried, modules) == expected


def test_recorded_failures_have_no_absolute_paths():
    """Files are recorded by name."""
    told = 'see /tmp/a-b/basecal.txt <- File "/usr/lib/python3/linalg.py", line 144, 3 m/s'
    assert record.without_folders(told) == 'see basecal.txt <- File "linalg.py", line 144, 3 m/s'
    for row in record.read():
        for found in row.seeds.values():
            assert all(record.without_folders(why) == why for why in found.values())
