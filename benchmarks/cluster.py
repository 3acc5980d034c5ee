"""What a Dask cluster adds: one study by processes of this machine and by as many local Dask workers, in turn.

Both start with nothing and end with all chunks kept; the cluster is up before, as one that people have is.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from basecal.studies.jobs import Where
from basecal.studies.run import run_study
from basecal.studies.study_file import study_from_text
from benchmarks.common import table, write
from benchmarks.study import BOARD

MOST_OVERHEAD = 0.15
HEAD = ("trials", "workers", "processes [s]", "Dask [s]", "overhead", "asked")


def seconds(trials: int, where: Where) -> float:
    """Wall time of the study."""
    text = f"schema: basecal/study/1\ntrials: {trials}\ncells: 8\nhold: {{{BOARD}}}\n"
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        run_study(study_from_text(text, "study.yaml"), Path(folder) / "out", where)
        return time.perf_counter() - begin


def measured(trials: int, workers: int, repeats: int) -> dict[str, Any]:
    """Times of both, one after the other."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        seconds(512 * workers, Where(1, cluster.scheduler_address))  # imports, as processes make them in their time
        ways = {"processes": Where(workers), "dask": Where(1, cluster.scheduler_address)}
        times: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(repeats):
            for name, where in ways.items():
                times[name].append(seconds(trials, where))
    found = {f"{name}_s": median(of) for name, of in times.items()}
    overhead = median(d / p for d, p in zip(times["dask"], times["processes"], strict=True)) - 1
    return {"trials": trials, "workers": workers, **found, "overhead": overhead, "all": times}


def row(found: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    times = (f"{found['processes_s']:.1f}", f"{found['dask_s']:.1f}")
    return f"{found['trials']:,}", str(found["workers"]), *times, f"{found['overhead']:.1%}", f"{MOST_OVERHEAD:.0%}"


def main(arguments: list[str]) -> None:
    """Measure, print, write results/cluster.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cluster", description=__doc__)
    parser.add_argument("--trials", type=int, default=200_000)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--repeats", type=int, default=3)
    asked = parser.parse_args(arguments)
    found = measured(asked.trials, asked.workers, asked.repeats)
    print(table(HEAD, [row(found)]))
    write("cluster", {"rows": [found]})


if __name__ == "__main__":
    main(sys.argv[1:])
