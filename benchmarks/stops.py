"""Stops of two arms with third-party drivers, one of which fails: when the other arm stops, and what is sent then.

The full product of ten faults of a controller or link, the arm, the order in the cell, and the phase of the arms (idle,
moving, at rest, reconnecting) is run. Each case has its own seed for the instant. The controllers run in a separate
process and log their commands on the system's clock. Allowed are 0.3 s after an event, 0.6 s after a link falls silent
while an arm moves, and 2.3 s for an arm that reports that it stands still during a move. While all arms stand, a lost
link is tried again for `reconnect_s`.

A trial mostly waits. `--jobs` trials therefore run at the same time, each with its own processes and ports. Run nothing
else beside them. Each trial keeps the load of the machine, and the longest delay of a sleeping thread.
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
    cases = product(seeds, FAULTS, PHASES, ARMS, (ARMS, ARMS[::-1]))
    trials = [Trial(fault, arm, order, phase, seed) for seed, fault, phase, arm, order in cases]
    outcomes_by_case: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        running = {trial: pool.submit(_try, trial) for trial in trials if _key(trial) not in kept}
        for trial in trials:
            outcomes_by_case[trial.phase, trial.fault].append(
                kept.of(_key(trial), lambda trial=trial: running[trial].result())
            )
    return [_row(phase, fault, outcomes) for (phase, fault), outcomes in sorted(outcomes_by_case.items())]


def _key(trial: Trial) -> str:
    return f"{trial.fault}-{trial.phase}-{trial.arm}-{'-'.join(trial.order)}-{trial.seed}"


def _try(trial: Trial) -> dict[str, Any]:
    sleeper = _Sleeper()
    outcome = attempt(trial)
    delays = {"load": os.getloadavg()[0], "woken_late_s": sleeper.longest_s()}
    return {**asdict(outcome), "broken": faults_found(trial, outcome), **delays}


class _Sleeper:
    """A thread that sleeps briefly in a loop, and records how late it wakes up."""

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
        """End the thread, and return its longest delay [s]."""
        self._is_over.set()
        self._thread.join()
        return self._late_s


def _row(phase: str, fault: str, outcomes: list[dict[str, Any]]) -> dict[str, Any]:
    stopped_s = [each["other_stopped_s"] for each in outcomes if each["other_stopped_s"] is not None]
    ended_s = [each["ended_s"] for each in outcomes if each["ended_s"] is not None]
    return {
        "phase": phase,
        "fault": fault,
        "trials": len(outcomes),
        "broken": sum(bool(each["broken"]) for each in outcomes),
        "told_s": None if not stopped_s else [float(np.median(stopped_s)), max(stopped_s)],
        "ended_s": None if not ended_s else max(ended_s),
        "moves_after": sum(each["moves_after"] for each in outcomes),
        "load": max(each["load"] for each in outcomes),
        "woken_late_s": max(each["woken_late_s"] for each in outcomes),
    }


def _table_row(row: dict[str, Any]) -> list[str]:
    stopped_s = "-" if row["told_s"] is None else f"{row['told_s'][0]:.3f}, {row['told_s'][1]:.3f}"
    ended = "-" if row["ended_s"] is None else f"{row['ended_s']:.2f}"
    return [
        row["phase"],
        row["fault"],
        str(row["trials"]),
        str(row["broken"]),
        stopped_s,
        ended,
        str(row["moves_after"]),
    ]


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
    return f"{about}\n\n{table(HEAD, map(_table_row, rows))}"


def main() -> int:
    """Run, print the table and write it; return 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=range(20), help="of the instants, a full product each")
    parser.add_argument("--keep", type=Path, help="file of trials that are kept, so that a run can go on")
    parser.add_argument("--jobs", type=int, default=1, help="trials side by side")
    asked = parser.parse_args()
    with installed_driver(Path(tempfile.mkdtemp()), "frail", DRIVER):
        table_rows = rows(Kept(asked.keep), asked.seeds, asked.jobs)
    print(table(HEAD, map(_table_row, table_rows)))
    write("stops", {"rows": table_rows})
    return int(any(row["broken"] for row in table_rows))


if __name__ == "__main__":
    sys.exit(main())
