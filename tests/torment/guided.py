"""Damaged files guided by coverage: `python -m torment.guided --seconds 120`.

The chance by which a trial damages its file is a row of words. A row that reached lines of a reader which none had
reached is kept, and others are made of it by changing a few words or what follows one. Printed for each kind are its
trials, the lines that they reached of all lines of the functions that they entered, and failures with its words.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import CodeType, FrameType
from typing import Any

import basecal
from basecal.box import is_own_fault
from basecal.errors import InputError
from basecal.exchange.bags.reader_process import read_frames
from basecal.exchange.workbook_boxed import read_frames as read_sheet
from torment import record
from torment.besides import damage_bag
from torment.foreign import write_damaged_tables
from torment.outcome import TrialFailed, run_reader
from torment.readers import READERS, Trial
from torment.record import Row, table
from torment.workbooks import write_damaged_workbook

_SOURCES = str(Path(basecal.__file__).parent)
_ROOMS = ("/exchange/", "/cell/", "/fields/", "/kinematics/", "/vision/image_file", "/studies/", "/acquisition/capture")
_WORD = 64  # bits
_FRESH = 0.2  # of the trials are of a new row
_MOST_CHANGED = 3
Line = tuple[str, int]


class Words(Random):
    """Chance by given words, and by a seed behind them; which words were taken is in `taken`."""

    def __new__(cls, *given: object) -> Words:
        """One that ignores what it is given."""
        return super().__new__(cls)

    def __init__(self, given: Sequence[int], seed: int) -> None:
        super().__init__(seed)
        self.taken: list[int] = []
        self._given, self._further = given, Random(seed)

    def getrandbits(self, count: int) -> int:
        """So many bits, of as many words as they need."""
        found = 0
        for _ in range(-(-count // _WORD)):
            found = found << _WORD | self._next()
        return found >> (-count % _WORD)

    def random(self) -> float:
        """A number from 0 to below 1."""
        return (self._next() >> 11) / 2**53

    def _next(self) -> int:
        k = len(self.taken)
        self.taken.append(self._given[k] if k < len(self._given) else self._further.getrandbits(_WORD))
        return self.taken[-1]


def read_bag(chance: Random, folder: Path) -> str:
    """A damaged bag, in this process."""
    path = damage_bag(chance, folder)

    def read() -> None:
        try:
            for topics in ((), ("/joint_states", "/arm/pose")):
                list(read_frames([str(path), *topics]))
        except Exception as error:  # of its library, which the box tells as what it is
            if is_own_fault(error):
                raise
            raise InputError(type(error).__name__) from error

    return run_reader(read)


def read_tables(chance: Random, folder: Path) -> str:
    """A damaged dataset of LeRobot, in this process."""
    from basecal.exchange.lerobot_boxed import read_frames as read_table

    path = write_damaged_tables(chance, folder)

    def read() -> None:
        try:
            list(read_table(["0", "timestamp,observation.state", str(path)]))
        except Exception as error:  # likewise
            if is_own_fault(error):
                raise
            raise InputError(type(error).__name__) from error

    return run_reader(read)


def read_sheets(chance: Random, folder: Path) -> str:
    """A damaged workbook, in this process."""
    path = write_damaged_workbook(chance, folder)
    return run_reader(lambda: list(read_sheet([str(path)])))


KINDS: dict[str, Trial] = {**READERS, "workbook": read_sheets, "bag": read_bag, "Parquet": read_tables}


class Reached:
    """Lines of the readers that trials reached, and all lines of the functions that they entered."""

    def __init__(self) -> None:
        self.lines: set[Line] = set()
        self.possible: set[Line] = set()
        self._codes: dict[CodeType, bool] = {}

    def follow(self, act: Callable[[], str]) -> tuple[str, int]:
        """What came of an act, and how many lines it reached first."""
        before = len(self.lines)
        sys.settrace(self._enter)
        try:
            came = act()
        finally:
            sys.settrace(None)
        return came, len(self.lines) - before

    def _enter(self, frame: FrameType, event: str, argument: Any) -> Callable[[FrameType, str, Any], Any] | None:
        code = frame.f_code
        if code not in self._codes:
            self._codes[code] = code.co_filename.startswith(_SOURCES) and any(
                room in code.co_filename for room in _ROOMS
            )
            if self._codes[code]:
                self.possible |= {(code.co_filename, line) for _, _, line in code.co_lines() if line is not None}
                self.lines.add((code.co_filename, code.co_firstlineno))
        return self._step if self._codes[code] else None

    def _step(self, frame: FrameType, event: str, argument: Any) -> Any:
        self.lines.add((frame.f_code.co_filename, frame.f_lineno))
        return self._step


def during(seconds: float) -> Iterator[None]:
    """As many trials as begin within so many seconds."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        yield


def guided(kind: str, trials: Iterable[object], chance: Random, is_guided: bool = True) -> tuple[Counter[str], Reached]:
    """What came of trials of a kind, and what they reached; without guidance every row is new."""
    came, reached, kept = Counter[str](), Reached(), list[list[int]]()
    with TemporaryDirectory(prefix="torment-") as folder, suppress(TrialFailed):
        KINDS[kind](Random(0), Path(folder))  # what is made once is no reader's
    for _ in trials:
        is_fresh = not is_guided or not kept or chance.random() < _FRESH
        words = Words([] if is_fresh else _changed(chance.choice(kept), chance), chance.getrandbits(32))
        with TemporaryDirectory(prefix="torment-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
            try:
                what, new = reached.follow(lambda: KINDS[kind](words, Path(folder)))  # noqa: B023
            except TrialFailed as error:
                what, new = "failed", 0
                print(f"{kind}: {error}; words {words.taken}", file=sys.stderr, flush=True)
        came[what] += 1
        if new:
            kept.append(words.taken)
    return came, reached


def _changed(words: list[int], chance: Random) -> list[int]:
    """A row with a few words changed, or cut off behind one of them."""
    other = list(words)
    for _ in range(chance.randint(1, _MOST_CHANGED)):
        if other:
            other[chance.randrange(len(other))] = chance.getrandbits(_WORD)
    return other[: chance.randrange(len(other) + 1)] if chance.random() < 0.5 else other


def recorded_name(kind: str) -> str:
    """What trials of a kind are in what is recorded: they have numbers, and no seeds."""
    return f"{kind}, guided"


def _record(kind: str, came: Counter[str], path: Path) -> None:
    rows, name = record.read(path), recorded_name(kind)
    first = record.next_seed(rows, name)
    record.write(record.added(rows, Row(name, record.commit(), first, first + came.total(), dict(came))), path)


def _rows(
    kinds: Sequence[str], seconds: float, seed: int, is_guided: bool, path: Path | None
) -> Iterator[tuple[object, ...]]:
    for kind in kinds:
        came, reached = guided(kind, during(seconds / len(kinds)), Random(f"{kind} {seed}"), is_guided)
        if path:
            _record(kind, came, path)
        lines = len(reached.lines & reached.possible)
        yield kind, came.total(), came["answered"], came["refused"], came["failed"], lines, len(reached.possible)


def main() -> int:
    """Try each kind for its share of the time, print a table, and end with 1 after any failure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=120)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", choices=list(KINDS))
    parser.add_argument("--unguided", action="store_true", help="by new words alone, to compare")
    parser.add_argument("--record", type=Path, nargs="?", const=record.FILE, help="add the counts to this file")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    rows = list(_rows(asked.only or list(KINDS), asked.seconds, asked.seed, not asked.unguided, asked.record))
    print(table(("kind", "tried", "answered", "refused", "failed", "lines", "of"), rows))
    return 1 if any(row[4] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
