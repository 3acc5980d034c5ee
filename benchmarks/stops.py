"""Stops: two arms by drivers of others, one of which fails; when the other is told to stop, and what is sent after.

The full product of ten faults of a controller or link, the arm, the order in the cell, and what the arms do at that
time (idle, moving, at rest, reconnecting), each with its own seed for the instant. The controllers run in a process of
their own and log what they are told on the system's clock. Allowed: 0.3 s after an event, 0.6 s after a link falls
silent while an arm moves, 2.3 s for an arm that says that it stands still on its way. While all arms stand, a lost link
is tried again for `reconnect_s`.

Most of a trial is waiting, so that `--jobs` run side by side, each in processes and on ports of its own. Run nothing
else beside them. Each trial keeps the load of the machine, and the longest time by which it woke a sleeper late.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from tests.safety.installed_driver import installed_driver
from tests.safety.link_trial import ARMS, FAULTS, PHASES, RECONNECT_S, REST_S, Trial, attempt, faults_found

from benchmarks.common import Kept, table, write

DRIVER = Path(__file__).parents[1] / "tests" / "safety" / "frail_driver.py"
HEAD = (
    "phase",
    "fault",
    "trials",
    "broken",
    "other arm stopped: median, longest [s]",
    "ended, longest [s]",
    "moves after",
)
_NAP_S = 0.005


def rows(kept: Kept, seeds: Iterable[int], jobs: int) -> list[dict[str, Any]]:
    """Times by fault and phase, over arms, orders and seeds."""
    asked = product(seeds, FAULTS, PHASES, ARMS, (ARMS, ARMS[::-1]))
    trials = [Trial(fault, arm, order, phase, seed) for seed, fault, phase, arm, order in asked]
    found: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        running = {trial: pool.submit(_tried, trial) for trial in trials if _key(trial) not in kept}
        for trial in trials:
            found[trial.phase, trial.fault].append(kept.of(_key(trial), lambda trial=trial: running[trial].result()))
    return [_row(phase, fault, outcomes) for (phase, fault), outcomes in sorted(found.items())]


def _key(trial: Trial) -> str:
    return f"{trial.fault}-{trial.phase}-{trial.arm}-{'-'.join(trial.order)}-{trial.seed}"


def _tried(trial: Trial) -> dict[str, Any]:
    machine = _Sleeper()
    outcome = attempt(trial)
    late = {"load": os.getloadavg()[0], "woken_late_s": machine.longest_s()}
    return {**asdict(outcome), "broken": faults_found(trial, outcome), **late}


class _Sleeper:
    """A thread that sleeps a little again and again, and notes how late it is woken."""

    def __init__(self) -> None:
        self._late_s, self._is_over = 0.0, threading.Event()
        self._thread = threading.Thread(target=self._sleep, daemon=True)
        self._thread.start()

    def _sleep(self) -> None:
        while not self._is_over.is_set():
            due_s = time.monotonic() + _NAP_S
            time.sleep(_NAP_S)
            self._late_s = max(self._late_s, time.monotonic() - due_s)

    def longest_s(self) -> float:
        """End it; the longest time by which it was woken late [s]."""
        self._is_over.set()
        self._thread.join()
        return self._late_s


def _row(phase: str, fault: str, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
    told = [each["other_stopped_s"] for each in outcomes if each["other_stopped_s"] is not None]
    ended = [each["ended_s"] for each in outcomes if each["ended_s"] is not None]
    return {
        "phase": phase,
        "fault": fault,
        "trials": len(outcomes),
        "broken": sum(bool(each["broken"]) for each in outcomes),
        "told_s": None if not told else [float(np.median(told)), max(told)],
        "ended_s": None if not ended else max(ended),
        "moves_after": sum(each["moves_after"] for each in outcomes),
        "load": max(each["load"] for each in outcomes),
        "woken_late_s": max(each["woken_late_s"] for each in outcomes),
    }


def _shown(row: dict[str, Any]) -> list[str]:
    told = "-" if row["told_s"] is None else f"{row['told_s'][0]:.3f}, {row['told_s'][1]:.3f}"
    ended = "-" if row["ended_s"] is None else f"{row['ended_s']:.2f}"
    return [row["phase"], row["fault"], str(row["trials"]), str(row["broken"]), told, ended, str(row["moves_after"])]


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows = result["rows"]
    trials, broken = (sum(row[key] for row in rows) for key in ("trials", "broken"))
    about = f"""\
A third-party driver runs two arms. A controller or link of one arm fails, and the other arm must stop. Every fault
occurs in every phase, for either arm and either order in the cell, at random instants. Of {trials} trials {broken}
broke a promise.

Times are from the fault on. While all arms stand, a lost link is tried again for {RECONNECT_S:g} s, and a silent link
counts as lost after {REST_S:g} s. `lie` is a state that never changes. It stops no arm if all arms stand. The load of
the machine was at most {max(row["load"] for row in rows):.1f} on {result["machine"]["cores"]} cores. It woke a
sleeping process at most {max(row["woken_late_s"] for row in rows):.2f} s late."""
    return f"{about}\n\n{table(HEAD, map(_shown, rows))}"


def main() -> int:
    """Run it, print the table, write it down; 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=range(20), help="of the instants, a full product each")
    parser.add_argument("--keep", type=Path, help="file of trials that are kept, so that a run can go on")
    parser.add_argument("--jobs", type=int, default=1, help="trials side by side")
    given = parser.parse_args()
    with installed_driver(Path(tempfile.mkdtemp()), "frail", DRIVER):
        found = rows(Kept(given.keep), given.seeds, given.jobs)
    print(table(HEAD, map(_shown, found)))
    write("stops", {"rows": found})
    return int(any(row["broken"] for row in found))


if __name__ == "__main__":
    sys.exit(main())
