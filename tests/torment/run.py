"""Torment for as long as asked: `python -m torment.run --seconds 120 --seed 0`; a table, and failures by seed.

A failure is tried again by `python -m torment.run --only "calibrate" --seed 17 --trials 1`. With `--record` the seeds
are those that were not tried yet, and what came of them is added to benchmarks/results/torment.json now and then.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from torment import record
from torment.outcome import TrialFailed
from torment.readers import READERS, Trial
from torment.record import REMARKABLE, Row, commit, table
from torment.trials import WHOLE
from torment.warm import boxes

TRIALS: dict[str, Trial] = {**READERS, **WHOLE}
GROUPS = {"readers": list(READERS), "whole": list(WHOLE)}
_READERS_AT_ONCE = 20  # trials of a reader for each of the others, which take so much longer
_RECORDED_AT_ONCE = {name: 500 if name in READERS else 10 for name in TRIALS}  # a few seconds
_FIRST_RECORDED = 10_000_000  # seeds below are for tests and for looking at by hand
_LONGEST_WHY = 300  # characters of failures that are kept
_MEMORY = Path("/dev/shm")  # a folder in memory, where there is one
_LARGEST_MB = 1024  # of a process that does nothing else: what is refused takes no more
_BY_ITSELF_MB = 200  # of that, what it has before it reads anything


def tried(name: str, seed: int) -> str:
    """What came of one trial.

    Raises:
        TrialFailed: if it ended as none may.
    """
    where = _MEMORY if _MEMORY.is_dir() else None
    with TemporaryDirectory(prefix="torment-", dir=where, ignore_cleanup_errors=True) as folder:
        most = max(peak_mb(), resident_mb() + _LARGEST_MB - _BY_ITSELF_MB)
        with boxes():
            came = TRIALS[name](Random(f"{name} {seed}"), Path(folder))
    if peak_mb() > most:
        raise TrialFailed(f"took {peak_mb():.0f} MB")
    return came


def peak_mb() -> float:
    """The most memory that this process had so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def resident_mb() -> float:
    """What this process has now; the most it had where that is not told."""
    held = Path("/proc/self/statm")
    return int(held.read_text().split()[1]) * resource.getpagesize() / 2**20 if held.exists() else peak_mb()


def some(name: str, first: int, count: int) -> Row:
    """The trials of some seeds; failures is printed."""
    came: Counter[str] = Counter()
    seeds: dict[str, dict[str, str]] = {}
    for seed in range(first, first + count):
        why = ""
        try:
            what = tried(name, seed)
        except TrialFailed as error:
            what, why = "failed", record.without_folders(str(error))[:_LONGEST_WHY]
            print(f"{name}, seed {seed}: {error}", file=sys.stderr, flush=True)
        came[what] += 1
        if what in REMARKABLE:
            seeds.setdefault(what, {})[str(seed)] = why
    return Row(name, _COMMIT, first, first + count, dict(came), seeds)


_COMMIT = commit()


def torment(names: list[str], seconds: float, seed: int, most: int | None) -> Iterator[Row]:
    """What came of the trials of each name, in turn from a seed on, until time or number is over."""
    end, turn = time.monotonic() + seconds, 0
    while time.monotonic() < end and (most is None or turn < most):
        for name in names:
            if time.monotonic() >= end:
                return
            count = _READERS_AT_ONCE if name in READERS and most is None else 1
            yield some(name, seed + turn * count, count)
        turn += 1


def recorded(names: list[str], seconds: float, path: Path) -> Iterator[Row]:
    """What came of trials by seeds that were not tried yet, each added to what is recorded as it comes."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for name in names:
            first = record.next_seed(record.read(path), name, _FIRST_RECORDED)
            row = some(name, first, _RECORDED_AT_ONCE[name])
            record.write(record.added(record.read(path), row), path)
            yield row


def counts_table(came: dict[str, Counter[str]]) -> str:
    """A line for each kind of trial."""
    return table(record.HEAD[:-1], [(name, counts.total(), *record.columns(counts)) for name, counts in came.items()])


def main() -> int:
    """Torment, print the table, and end with 1 after any failure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--trials", type=int)
    parser.add_argument("--only", action="append", choices=[*TRIALS, *GROUPS])
    parser.add_argument("--json", type=Path, help="write the counts to this file too")
    parser.add_argument("--record", type=Path, nargs="?", const=record.FILE, help="seeds not tried yet, added to this")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    began = time.monotonic()
    names = [name for each in asked.only or TRIALS for name in GROUPS.get(each, [each])]
    came: dict[str, Counter[str]] = {name: Counter() for name in names}
    seeded = torment(names, asked.seconds, asked.seed, asked.trials)
    for row in recorded(names, asked.seconds, asked.record) if asked.record else seeded:
        came[row.what].update(row.came)
    print(counts_table(came))
    print(f"\nseed {asked.seed}, {time.monotonic() - began:.0f} s, at most {peak_mb():.0f} MB")
    if asked.json:
        asked.json.write_text(json.dumps(came, indent=1))
    return 1 if any(counts["failed"] for counts in came.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
