"""One study by one process, by two, and by a Dask cluster of two and of four workers: time, and equal numbers.

Each begins with nothing and ends with all chunks kept. A cluster is started before, as in practice. Beside the wall
time there is the CPU time of all processes, which does not depend on other programs. A worker is killed midway, and so
is the whole command, which is then started again.
"""

from __future__ import annotations

import argparse
import hashlib
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from statistics import median
from typing import Any

from basecal.studies.chunk import COLUMNS
from basecal.studies.jobs import WorkerPool
from basecal.studies.run import run_study
from basecal.studies.study import Study
from basecal.studies.study_file import study_from_text
from basecal.studies.summary import results
from benchmarks.common import table, write
from benchmarks.study import BOARD

MOST_OVERHEAD = 0.15
MOST_BYTES = 2**30
HEAD = ("by", "wall time [s]", "CPU time [s]", "more wall time", "more CPU time", "largest process [MB]", "numbers")
KILLED_HEAD = ("killed midway", "numbers", "chunks kept", "chunks repeated")
_LEAST_DONE = 3  # chunks before something is killed


def make_study(trials: int) -> Study:
    """The study that all of them run."""
    return study_from_text(f"schema: basecal/study/1\ntrials: {trials}\ncells: 8\nhold: {{{BOARD}}}\n", "study.yaml")


def numbers(study: Study, folder: Path) -> str:
    """Digest of all numbers of the table except times."""
    digest = hashlib.sha256()
    for _, result in results(study, folder):
        for name in COLUMNS:
            if name != "time_s":
                digest.update(getattr(result.trials, name).tobytes())
    return digest.hexdigest()


@contextmanager
def start_cluster(workers: int) -> Iterator[Any]:
    """A local Dask cluster, whose workers have already imported the package."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        with tempfile.TemporaryDirectory() as folder:
            run_study(make_study(512 * workers), Path(folder) / "out", WorkerPool(1, cluster.scheduler_address))
        yield cluster


def _run_and_report(workers: int, scheduler: str | None, trials: int, answer: Any) -> None:
    """Run the study in this process, and put times, memory and digest into a queue."""
    study = make_study(trials)
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        run_study(study, Path(folder) / "out", WorkerPool(workers, scheduler))
        wall = time.perf_counter() - begin
        digest = numbers(study, Path(folder) / "out")
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    processor = sum(u.ru_utime + u.ru_stime for u in (own, children))
    answer.put((wall, processor, 1024 * max(own.ru_maxrss, children.ru_maxrss), digest))


def _worker_cpu_s(cluster: Any) -> float:
    """CPU time of a cluster's workers so far [s]."""
    import psutil

    spent = [psutil.Process(worker.pid).cpu_times() for worker in cluster.workers.values()]
    return sum(each.user + each.system for each in spent)


def measure(way: str, workers: int, cluster: Any, trials: int) -> dict[str, Any]:
    """Measure one way to run the study."""
    before_s = 0.0 if cluster is None else _worker_cpu_s(cluster)
    answer: Any = multiprocessing.get_context("spawn").Queue()
    address = None if cluster is None else cluster.scheduler_address
    process = multiprocessing.get_context("spawn").Process(
        target=_run_and_report, args=(workers, address, trials, answer)
    )
    process.start()
    wall, processor, peak, digest = answer.get()
    process.join()
    processor += 0.0 if cluster is None else _worker_cpu_s(cluster) - before_s
    return {"way": way, "wall_s": wall, "processor_s": processor, "peak_bytes": peak, "numbers": digest}


def run_with_kill(study: Study, work: Callable[[Path], None], kill: Callable[[], None]) -> dict[str, Any]:
    """Run a study of which something is killed midway, resume it, and count the chunks that were repeated."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "out"
        chunks = folder / "chunks"

        def kill_midway() -> None:
            """Kill once some chunks are done."""
            while not chunks.exists() or len(list(chunks.glob("*.npz"))) < _LEAST_DONE:
                time.sleep(0.02)
            kill()

        threading.Thread(target=kill_midway, daemon=True).start()
        work(folder)
        before = {path.name: path.stat().st_mtime_ns for path in chunks.glob("*.npz")}
        run_study(study, folder, WorkerPool(1))
        repeated = [name for name, time_ns in before.items() if (chunks / name).stat().st_mtime_ns != time_ns]
        return {
            "numbers": numbers(study, folder),
            "there": len(before),
            "again": len(repeated),
            "of": len(study.chunks),
        }


def measure_kills(trials: int) -> list[dict[str, Any]]:
    """Rows of kills: of a process of two, of a Dask worker of two, and of the whole command."""
    study, spawn = make_study(trials), multiprocessing.get_context("spawn")
    rows = [
        {
            "what": "nothing",
            **run_with_kill(study, lambda folder: run_study(study, folder, WorkerPool(1)), lambda: None),
        }
    ]

    def kill_worker_process() -> None:
        """Kill a worker of this process."""
        os.kill(multiprocessing.active_children()[0].pid or 0, signal.SIGKILL)

    with_processes = run_with_kill(study, lambda folder: run_study(study, folder, WorkerPool(2)), kill_worker_process)
    rows.append({"what": "one of two processes", **with_processes})
    with start_cluster(2) as cluster:

        def kill_dask_worker() -> None:
            """Kill a worker of the cluster."""
            os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)

        with_dask = run_with_kill(
            study, lambda folder: run_study(study, folder, WorkerPool(1, cluster.scheduler_address)), kill_dask_worker
        )
        rows.append({"what": "one of two Dask workers", **with_dask})
    command: list[Any] = []

    def run_in_process(folder: Path) -> None:
        """Run the study in a process that can be killed."""
        command.append(spawn.Process(target=run_study, args=(study, folder, WorkerPool(1))))
        command[0].start()
        command[0].join()

    whole = run_with_kill(study, run_in_process, lambda: command[0].kill())
    rows.append({"what": "the whole command, started again", **whole})
    return rows


def row(result: dict[str, Any], first: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    overheads = [f"{result[name]:.1%}" if name in result else "" for name in ("overhead", "processor_overhead")]
    times = f"{result['wall_s']:.1f}", f"{result['processor_s']:.1f}"
    same = "the same" if result["numbers"] == first["numbers"] else "OTHERS"
    return result["way"], *times, *overheads, f"{result['peak_bytes'] / 1e6:.0f}", same


def killed_row(result: dict[str, Any], first: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `KILLED_HEAD`."""
    same = "the same" if result["numbers"] == first["numbers"] else "OTHERS"
    return result["what"], same, f"{result['there']} of {result['of']}", str(result["again"])


def summarize(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Medians by way, with the overhead of Dask over two processes in the same round."""
    rounds: dict[str, list[dict[str, Any]]] = {}
    for each in rows:
        rounds.setdefault(each["way"], []).append(each)
    out = []
    for way, runs in rounds.items():
        assert len({each["numbers"] for each in runs}) == 1
        result = {**runs[0], **{name: median(each[name] for each in runs) for name in ("wall_s", "processor_s")}}
        if way.startswith("Dask"):
            reference = rounds["2 processes"]
            for name, field in (("overhead", "wall_s"), ("processor_overhead", "processor_s")):
                result[name] = median(d[field] / p[field] for d, p in zip(runs, reference, strict=True)) - 1
        out.append(result)
    return out


def main(arguments: list[str]) -> None:
    """Measure, print, write results/cluster.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cluster", description=__doc__)
    parser.add_argument("--trials", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--many", type=int, default=100_000, help="trials of the study whose memory is measured")
    parser.add_argument("--killed", type=int, default=8192, help="trials of the studies that are killed")
    asked = parser.parse_args(arguments)
    rows = []
    for _ in range(asked.repeats):
        for name, workers, is_dask in (
            ("1 process", 1, 0),
            ("2 processes", 2, 0),
            ("Dask, 2", 2, 1),
            ("Dask, 4", 4, 1),
        ):
            with start_cluster(workers) if is_dask else nullcontext() as cluster:
                rows.append(measure(name, workers, cluster, asked.trials))
                print(rows[-1], flush=True)
    many = measure("1 process", 1, None, asked.many) if asked.many else None
    rows_by_way, kill_rows = summarize(rows), measure_kills(asked.killed)
    print(table(HEAD, [row(each, rows_by_way[0]) for each in rows_by_way]))
    print(table(KILLED_HEAD, [killed_row(each, kill_rows[0]) for each in kill_rows]))
    sizes = {"trials": asked.trials, "killed_trials": asked.killed, "many_trials": asked.many, "many": many}
    write("cluster", {**sizes, "rows": rows_by_way, "all": rows, "killed": kill_rows})


if __name__ == "__main__":
    main(sys.argv[1:])
