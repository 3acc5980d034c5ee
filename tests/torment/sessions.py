"""Sessions of drivers with hostile peers, each in a process with little memory: `python -m torment.sessions`.

A session ends by itself within its patience, as a command may end. Three in ten are interrupted some time after their
command reports that it runs, and end by 130 within two seconds; what ended before its interrupt is counted as that.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from multiprocessing.process import BaseProcess
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple

from torment import record
from torment.devices import STAGES, prepare
from torment.outcome import CODES, TrialFailed
from torment.record import Row, table
from torment.warm import boxes, server

MOST_BYTES = 2**30  # of address space
PATIENCE_S = 90.0  # of any driver that is connected again for a second; an image of a simulated cell may take 60 s
INTERRUPTED_S = 2.0
_DELAYS_S = (0.1, 0.5, 1.0, 2.0, 5.0)  # from the report of a command to its interrupt, at most
_LOOK_S = 0.01  # between looks whether it reports
_EARLY = "ended before its interrupt"
_SHOWN = 300  # characters of what was printed


def _command(words: Sequence[str], said: str) -> None:
    """In the session's process: a command with its streams in a file."""
    from basecal.cli import main

    output = os.open(said, os.O_WRONLY | os.O_CREAT)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream, file in ((0, nowhere), (1, nowhere), (2, output)):
        os.dup2(file, stream)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with boxes():
        os._exit(main(words))


class Came(NamedTuple):
    """What came of a session, and how long it took from its interrupt, or from its start if it had none [s]."""

    what: str
    took_s: float


def session(name: str, chance: Random, folder: Path) -> Came:
    """Hold one session.

    Raises:
        TrialFailed: if it ended as none may, or not in time.
    """
    prepare(name)
    delay_s = chance.choice(_DELAYS_S) * chance.random() if chance.random() < 0.3 else None
    said = folder / "said"
    with STAGES[name](chance, folder) as words:
        process = server().Process(target=_command, args=(words, str(said)))
        process.start()
        began_s = time.monotonic()
        is_interrupted = delay_s is not None and _runs_until(process, said, delay_s)
        if is_interrupted:
            began_s = time.monotonic()
            os.kill(process.pid or 0, signal.SIGINT)
        code = _exit_code(process, INTERRUPTED_S if is_interrupted else PATIENCE_S)
        took_s = time.monotonic() - began_s
    what = _judged(code, said.read_text(errors="replace") if said.exists() else "", is_interrupted)
    return Came(what if delay_s is None or is_interrupted else _EARLY, took_s)


def _runs_until(process: BaseProcess, said: Path, delay_s: float) -> bool:
    """Whether a command still runs some time after it reported that it does."""
    while not _reports(process.pid or 0, said):
        process.join(_LOOK_S)
        if process.exitcode is not None:
            return False
    process.join(delay_s)
    return process.exitcode is None


def _reports(process: int, said: Path) -> bool:
    """Whether a command said what it connects to or, with a file of its own cell, started its driver's process."""
    if said.exists() and said.stat().st_size:
        return True
    return bool(_children(process))


def _exit_code(process: BaseProcess, limit_s: float) -> int:
    """How a process ends within a limit, without the time in which other programs had the processor.

    Raises:
        TrialFailed: if it does not; it is killed.
    """
    began_s, kept_waiting_s = time.monotonic(), _kept_waiting_s(process.pid or 0)
    left_s = limit_s
    while process.exitcode is None and left_s > 0:
        process.join(left_s)
        lost_s = max(0.0, _kept_waiting_s(process.pid or 0) - kept_waiting_s)
        left_s = limit_s + lost_s - (time.monotonic() - began_s)
    if process.exitcode is None:
        where = _where(process.pid or 0)
        process.kill()
        process.join()
        raise TrialFailed(f"does not end within {limit_s:g} s: {where}")
    return process.exitcode


def _kept_waiting_s(process: int) -> float:
    """How long a process and its children were ready to run and had no processor [s], which is no fault of theirs."""
    lost_ns = 0
    for each in (process, *_children(process)):
        with suppress(OSError):
            lost_ns += int(Path(f"/proc/{each}/schedstat").read_text().split()[1])
    return lost_ns * 1e-9


def _children(process: int) -> list[int]:
    try:
        return [int(each) for each in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    except OSError:  # it ended
        return []


def _what(name: str, chance: Random, folder: Path) -> str:
    return session(name, chance, folder).what


SESSIONS = {name: partial(_what, name) for name in STAGES}


def _where(process: int) -> str:
    """In which calls of the system the threads of a process wait."""
    found = []
    for task in Path(f"/proc/{process}/task").glob("*"):
        found.append((task / "wchan").read_text() or (task / "stat").read_text().split()[2])
    return ", ".join(found)


def _judged(code: int, said: str, is_interrupted: bool = False) -> str:
    """What a command came to: `interrupted` by 130 alone, and by nothing else if it was."""
    if code not in CODES or is_interrupted != (code == 130):
        raise TrialFailed(f"exit code {code}: {said[-_SHOWN:]!r}")
    lines = [line for line in said.splitlines() if " connects to " not in line]
    errors = [line for line in lines if line.startswith("basecal: error: ")]
    if lines != errors or len(errors) != (code in (2, 3, 130)):
        raise TrialFailed(f"exit code {code}, and says {said[-_SHOWN:]!r}")
    if any(not (each.isprintable() or each == "\n") for each in said):
        raise TrialFailed(f"says what steers a terminal: {said[-_SHOWN:]!r}")
    return CODES[code]


def by_seed(name: str, seed: int) -> tuple[Came, str]:
    """What came of one session, and why it failed."""
    with TemporaryDirectory(prefix="torment-", ignore_cleanup_errors=True) as folder:
        try:
            return session(name, Random(f"{name} {seed}"), Path(folder)), ""
        except TrialFailed as error:
            print(f"{name}, seed {seed}: {error}", file=sys.stderr, flush=True)
            return Came("failed", 0.0), str(error)[:_SHOWN]


def sessions(name: str, first: int, count: int, at_once: int) -> Row:
    """What came of some seeds, several at once: most of their time they wait."""
    prepare(name)
    seeds = range(first, first + count)
    with ThreadPoolExecutor(at_once) as pool:
        found = list(pool.map(lambda seed: by_seed(name, seed), seeds))
    came = Counter(each.what for each, _ in found)
    for what in came:
        longest_s = max(each.took_s for each, _ in found if each.what == what)
        print(f"{name}: {what} {came[what]}, at most {longest_s:.2f} s", file=sys.stderr, flush=True)
    failures = {str(seed): why for seed, (each, why) in zip(seeds, found, strict=True) if each.what == "failed"}
    return Row(name, record.commit(), first, first + count, dict(came), {"failed": failures} if failures else {})


def _rows(names: Sequence[str], first: int, count: int, at_once: int) -> Iterator[Row]:
    for name in names:
        began_s = time.monotonic()
        row = sessions(name, first, count, at_once)
        print(f"{name}: {time.monotonic() - began_s:.0f} s", file=sys.stderr, flush=True)
        yield row


def main() -> int:
    """Hold the sessions, print what came of them, and end with 1 after any failure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=200, help="of each driver")
    parser.add_argument("--at-once", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", choices=list(STAGES))
    parser.add_argument("--record", type=Path, nargs="?", const=record.FILE)
    asked = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    rows = []
    for row in _rows(asked.only or list(STAGES), asked.seed, asked.sessions, asked.at_once):
        rows.append(row)
        if asked.record:
            record.write(record.added(record.read(asked.record), row), asked.record)
    print(table(("what", "sessions", "came"), [(row.what, sum(row.came.values()), row.came) for row in rows]))
    return 1 if any(row.came.get("failed") for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
