"""Tests of a few trials of each kind, and of the detection of failures: `make torment` runs more."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from random import Random

import pytest

from torment import outcome, run
from torment.damage import at, damaged, places
from torment.outcome import TrialFailed, run_command, run_reader, time_limit
from torment.readers import READERS
from torment.run import TRIALS, counts_table, torment, tried
from torment.sessions import SESSIONS

# Seeds that once failed
FOUND = (
    ("samples.jsonl", 258),
    ("samples.jsonl", 882),
    ("calibration.json", 102868),
    ("cell.yaml", 500451),
    ("cell.yaml", 10011602),
    ("industrial", 10003224),
    ("industrial", 10003812),
    ("write faults", 889),
    ("capture journal", 146),
    *(
        pytest.param("calibrate, numbers", seed, marks=pytest.mark.slow)
        for seed in (10000077, 10000185, 10001213, 10001570, 10002376, 10003317, 10004458)
    ),
)


@pytest.mark.parametrize("name", READERS)
def test_readers_accept_or_refuse_damaged_files(name: str) -> None:
    """Ten damaged files are read or refused, and of sixty some each."""
    came = {tried(name, seed) for seed in range(10)}
    later = iter(range(10, 60))
    while len(came) < 2:
        came.add(tried(name, next(later)))
    assert came == {"answered", "refused"}, name


@pytest.mark.parametrize(("name", "seed"), FOUND)
def test_earlier_failures_are_fixed(name: str, seed: int) -> None:
    """These damages failed once, and are repeated by their seed."""
    assert tried(name, seed) in ("answered", "refused")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", sorted(TRIALS.keys() - READERS.keys() - SESSIONS.keys()))
def test_commands_survive_damaged_cells(name: str) -> None:
    """Commands run on damaged cells, with hostile texts, and interrupted at their writes."""
    assert Counter(tried(name, seed) for seed in range(25)).total() == 25


def test_damage_is_repeatable_and_has_an_effect() -> None:
    """A seed always makes the same damage, and nearly each seed makes one."""
    data = {"a": [1, 2.5, {"b": "text"}], "c": None}
    made = [repr(damaged(data, Random(seed))) for seed in range(200)]
    assert made == [repr(damaged(data, Random(seed))) for seed in range(200)]
    assert sum(each != repr(data) for each in made) > 180
    assert [at(data, place) for place in places(data)][-1] is None


def _without_end() -> None:
    while True:
        pass


def test_waiting_process_fails_and_slow_process_continues(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process with some CPU time is slow because of others; one without any waits for an event that never comes."""
    monkeypatch.setattr(outcome, "_WAITING", 0.25)
    monkeypatch.setattr(outcome, "_IDLE_S", 0.05)
    with time_limit(2):
        end = time.process_time() + 0.5
        while time.process_time() < end:
            pass
    with pytest.raises(TrialFailed, match="took more than 2 s"), time_limit(2):
        time.sleep(5)


def test_limit_is_stated_in_units_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine on which a unit takes longer has more time, in the same ratio."""
    outcome.longest_s.cache_clear()
    monkeypatch.setattr(outcome, "unit_s", lambda: 0.05 / outcome.LONGEST_UNITS)
    with pytest.raises(TrialFailed, match=r"took more than 0\.05 s"), time_limit():
        _without_end()
    outcome.longest_s.cache_clear()


def test_failures_are_found(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A traceback, a hang, and an exit code outside the contract are reported with their seed and counted."""
    with pytest.raises(TrialFailed, match="ZeroDivisionError"):
        run_reader(lambda: 1 // 0)
    with pytest.raises(TrialFailed, match=r"took more than 0\.3 s"), time_limit(0.3):
        _without_end()
    monkeypatch.setattr("basecal.cell.files.read_cell", lambda folder: 1 // 0)
    with pytest.raises(TrialFailed, match=r"exit code 70: .*ZeroDivisionError.*test_trials\.py"):
        run_command(["calibrate", "x"])

    def falling(chance: Random, folder: Path) -> str:
        raise TrialFailed("on purpose")

    monkeypatch.setitem(run.TRIALS, "poses", falling)
    rows = list(torment(["poses"], 9.0, 5, 2))
    assert [(row.first, row.came, row.seeds) for row in rows] == [
        (seed, {"failed": 1}, {"failed": {str(seed): "on purpose"}}) for seed in (5, 6)
    ]
    assert "poses, seed 6: on purpose" in capsys.readouterr().err
    assert "| poses | 2 | 0 | 0 |  | 2 |" in counts_table({"poses": Counter({"failed": 2})})
