"""Sessions of drivers with hostile peers, each in a process with little memory: `python -m torment.sessions`.

A session ends by itself within its patience, as a command may end; one that is interrupted ends within two seconds.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from torment import record
from torment.devices import STAGES, prepare
from torment.outcome import CODES, Fell
from torment.record import Row, table

MOST_BYTES = 2**30  # of address space
PATIENCE_S = 90.0  # of any driver that is connected again for a second; a picture of a simulated cell may take 60 s
INTERRUPTED_S = 2.0
_SLACK = 1.5  # beside other sessions on this machine
_FIRST_S = (0.1, 0.5, 1.0, 2.0, 5.0)  # when sessions are interrupted
_SHOWN = 300  # characters of what was printed
_PRELOADED = ["basecal.cli.driver_check", "basecal.acquisition.driver_check.check_process", "basecal.cell.files"]
_PRELOADED += [f"basecal.acquisition.drivers.{kind}" for kind in ("ur", "opcua", "ros2", "opencv", "simulated")]
_PRELOADED += ["rtde_receive", "rtde_control", "asyncua.sync", "cyclonedds.sub"]


@cache
def _context() -> multiprocessing.context.ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    return context


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
    os._exit(main(words))


def session(name: str, chance: Random, folder: Path) -> str:
    """What came of one session.

    Raises:
        Fell: if it ended as none may, or not in time.
    """
    prepare(name)
    interrupted_s = chance.choice(_FIRST_S) * chance.random() if chance.random() < 0.3 else None
    with STAGES[name](chance, folder) as words:
        process = _context().Process(target=_command, args=(words, str(folder / "said")))
        process.start()
        process.join(PATIENCE_S if interrupted_s is None else interrupted_s)
        is_interrupted = interrupted_s is not None and process.exitcode is None
        if is_interrupted:
            os.kill(process.pid or 0, signal.SIGINT)
            process.join(INTERRUPTED_S * _SLACK)
        code = process.exitcode
        if code is None:
            where = _where(process.pid or 0)
            process.kill()
            process.join()
            raise Fell(f"{'is not interrupted' if is_interrupted else f'takes more than {PATIENCE_S:g} s'}: {where}")
    return _judged(code, (folder / "said").read_text(errors="replace") if (folder / "said").exists() else "")


SESSIONS = {name: partial(session, name) for name in STAGES}


def _where(process: int) -> str:
    """In which calls of the system the threads of a process wait."""
    found = []
    for task in Path(f"/proc/{process}/task").glob("*"):
        found.append((task / "wchan").read_text() or (task / "stat").read_text().split()[2])
    return ", ".join(found)


def _judged(code: int, said: str) -> str:
    if code not in CODES:
        raise Fell(f"exit code {code}: {said[-_SHOWN:]!r}")
    lines = [line for line in said.splitlines() if " connects to " not in line]
    errors = [line for line in lines if line.startswith("basecal: error: ")]
    if lines != errors or len(errors) != (code in (2, 3, 130)):
        raise Fell(f"exit code {code}, and says {said[-_SHOWN:]!r}")
    if any(not (each.isprintable() or each == "\n") for each in said):
        raise Fell(f"says what steers a terminal: {said[-_SHOWN:]!r}")
    return CODES[code]


def by_seed(name: str, seed: int) -> tuple[str, str]:
    """What came of one session, and why it fell."""
    with TemporaryDirectory(prefix="torment-", ignore_cleanup_errors=True) as folder:
        try:
            return session(name, Random(f"{name} {seed}"), Path(folder)), ""
        except Fell as error:
            print(f"{name}, seed {seed}: {error}", file=sys.stderr, flush=True)
            return "fell", str(error)[:_SHOWN]


def sessions(name: str, first: int, count: int, at_once: int) -> Row:
    """What came of some seeds, several at once: most of their time they wait."""
    prepare(name)
    seeds = range(first, first + count)
    with ThreadPoolExecutor(at_once) as pool:
        found = list(pool.map(lambda seed: by_seed(name, seed), seeds))
    came = {what: sum(what == each for each, _ in found) for what in sorted({each for each, _ in found})}
    fell = {str(seed): why for seed, (what, why) in zip(seeds, found, strict=True) if what == "fell"}
    return Row(name, record.commit(), first, first + count, came, {"fell": fell} if fell else {})


def _rows(names: Sequence[str], first: int, count: int, at_once: int) -> Iterator[Row]:
    for name in names:
        began_s = time.monotonic()
        row = sessions(name, first, count, at_once)
        print(f"{name}: {row.came}, {time.monotonic() - began_s:.0f} s", file=sys.stderr, flush=True)
        yield row


def main() -> int:
    """Hold the sessions, print what came of them, and end with 1 if any fell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=200, help="of each driver")
    parser.add_argument("--at-once", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", choices=list(STAGES))
    parser.add_argument("--record", type=Path, nargs="?", const=record.FILE)
    asked = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    rows = list(_rows(asked.only or list(STAGES), asked.seed, asked.sessions, asked.at_once))
    print(table(("what", "sessions", "came"), [(row.what, sum(row.came.values()), row.came) for row in rows]))
    if asked.record:
        known = record.read(asked.record)
        for row in rows:
            known = record.added(known, row)
        record.write(known, asked.record)
    return 1 if any(row.came.get("fell") for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
