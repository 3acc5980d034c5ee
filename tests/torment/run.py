"""Torment for as long as asked: `python -m torment.run --seconds 120 --seed 0`; a table, and what fell by its seed.

What fell is tried again by `python -m torment.run --only "calibrate" --seed 17 --trials 1`.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from torment.outcome import Fell
from torment.trials import READERS, WHOLE, Trial

TRIALS: dict[str, Trial] = {**READERS, **WHOLE}
_READERS_AT_ONCE = 20  # trials of a reader for each of the others, which take so much longer


def tried(name: str, seed: int) -> str:
    """What came of one trial.

    Raises:
        Fell: if it ended as none may.
    """
    with TemporaryDirectory(prefix="torment-", ignore_cleanup_errors=True) as folder:
        return TRIALS[name](Random(f"{name} {seed}"), Path(folder))


def torment(names: list[str], seconds: float, seed: int, most: int | None) -> dict[str, Counter[str]]:
    """How often what came of the trials of each name, in turn from a seed on, until time or number is over."""
    came: dict[str, Counter[str]] = {name: Counter() for name in names}
    end, turn = time.monotonic() + seconds, 0
    while time.monotonic() < end and (most is None or turn < most):
        for name in names:
            for each in range(_READERS_AT_ONCE if name in READERS and most is None else 1):
                number = seed + (turn * _READERS_AT_ONCE + each if name in READERS and most is None else turn)
                try:
                    came[name][tried(name, number)] += 1
                except Fell as error:
                    came[name]["fell"] += 1
                    print(f"{name}, seed {number}: {error}", file=sys.stderr)
        turn += 1
    return came


def table(came: dict[str, Counter[str]]) -> str:
    """A line for each kind of trial."""
    rows = ["| what | tried | answered | refused | else | fell |", "|---|---|---|---|---|---|"]
    for name, counts in came.items():
        others = ", ".join(f"{what} {n}" for what, n in sorted(counts.items()) if what not in _COLUMNS)
        shown = [counts["answered"], counts["refused"], others, counts["fell"]]
        rows.append(f"| {name} | {counts.total()} | {' | '.join(map(str, shown))} |")
    return "\n".join(rows)


_COLUMNS = ("answered", "refused", "fell")


def main() -> int:
    """Torment, print the table, and end with 1 where anything fell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--trials", type=int)
    parser.add_argument("--only", action="append", choices=list(TRIALS))
    parser.add_argument("--json", type=Path, help="write the counts to this file too")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    began = time.monotonic()
    came = torment(asked.only or list(TRIALS), asked.seconds, asked.seed, asked.trials)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(table(came))
    print(f"\nseed {asked.seed}, {time.monotonic() - began:.0f} s, at most {peak:.0f} MB")
    if asked.json:
        asked.json.write_text(json.dumps(came, indent=1))
    return 1 if any(counts["fell"] for counts in came.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
