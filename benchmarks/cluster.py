"""One study by one process, by two, and by a Dask cluster of two workers and of four: time, and the same numbers.

Each begins with nothing and ends with all chunks kept; a cluster is up before, as one that people have is. Beside the
wall time stands the time of the processor, of all who work, which does not depend on what else the machine does.
A worker is killed midway, and the whole command, which is then started again.
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

WAYS = {"1 process": 1, "2 processes": 2, "Dask, 2 workers": 2, "Dask, 4 workers": 4}
MOST_OVERHEAD = 0.15
MOST_BYTES = 2**30
HEAD = ("by", "wall time [s]", "CPU time [s]", "more wall time", "more CPU time", "largest process [MB]", "numbers")
KILLED_HEAD = ("killed midway", "numbers", "chunks kept", "chunks repeated")
_LEAST_DONE = 3  # chunks before something is killed


def study_of(trials: int) -> Study:
    """The study that all do."""
    return study_from_text(f"schema: basecal/study/1\ntrials: {trials}\ncells: 8\nhold: {{{BOARD}}}\n", "study.yaml")


def numbers(study: Study, folder: Path) -> str:
    """A digest of every number of the table but for times."""
    digest = hashlib.sha256()
    for _, result in results(study, folder):
        for name in COLUMNS:
            if name != "time_s":
                digest.update(getattr(result.trials, name).tobytes())
    return digest.hexdigest()


@contextmanager
def cluster_of(workers: int) -> Iterator[Any]:
    """A local Dask cluster, whose workers have imported what processes import in their time."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        with tempfile.TemporaryDirectory() as folder:
            run_study(study_of(512 * workers), Path(folder) / "out", WorkerPool(1, cluster.scheduler_address))
        yield cluster


def _spent(workers: int, scheduler: str | None, trials: int, answer: Any) -> None:
    """In a process of its own: times, memory and numbers of the study."""
    study = study_of(trials)
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        run_study(study, Path(folder) / "out", WorkerPool(workers, scheduler))
        wall = time.perf_counter() - begin
        found = numbers(study, Path(folder) / "out")
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    processor = sum(u.ru_utime + u.ru_stime for u in (own, children))
    answer.put((wall, processor, 1024 * max(own.ru_maxrss, children.ru_maxrss), found))


def _of_workers(cluster: Any) -> float:
    """Time of the processor that a cluster's workers have taken [s]."""
    import psutil

    spent = [psutil.Process(worker.pid).cpu_times() for worker in cluster.workers.values()]
    return sum(each.user + each.system for each in spent)


def measured(way: str, workers: int, cluster: Any, trials: int) -> dict[str, Any]:
    """One way to do the study."""
    before = 0.0 if cluster is None else _of_workers(cluster)
    answer: Any = multiprocessing.get_context("spawn").Queue()
    address = None if cluster is None else cluster.scheduler_address
    process = multiprocessing.get_context("spawn").Process(target=_spent, args=(workers, address, trials, answer))
    process.start()
    wall, processor, peak, found = answer.get()
    process.join()
    processor += 0.0 if cluster is None else _of_workers(cluster) - before
    return {"way": way, "wall_s": wall, "processor_s": processor, "peak_bytes": peak, "numbers": found}


def killed(study: Study, work: Callable[[Path], None], kill: Callable[[], None]) -> dict[str, Any]:
    """What comes of a study of which something is killed midway, and which chunks were done twice."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "out"
        chunks = folder / "chunks"

        def strike() -> None:
            """Wait until it is under way."""
            while not chunks.exists() or len(list(chunks.glob("*.npz"))) < _LEAST_DONE:
                time.sleep(0.02)
            kill()

        threading.Thread(target=strike, daemon=True).start()
        work(folder)
        before = {path.name: path.stat().st_mtime_ns for path in chunks.glob("*.npz")}
        run_study(study, folder, WorkerPool(1))
        again = [name for name, at in before.items() if (chunks / name).stat().st_mtime_ns != at]
        return {"numbers": numbers(study, folder), "there": len(before), "again": len(again), "of": len(study.chunks)}


def kills(trials: int) -> list[dict[str, Any]]:
    """A process of two, a Dask worker of two, and the whole command."""
    study, spawn = study_of(trials), multiprocessing.get_context("spawn")
    found = [{"what": "nothing", **killed(study, lambda folder: run_study(study, folder, WorkerPool(1)), lambda: None)}]

    def one_of_two() -> None:
        """A worker of this process."""
        os.kill(multiprocessing.active_children()[0].pid or 0, signal.SIGKILL)

    by_two = killed(study, lambda folder: run_study(study, folder, WorkerPool(2)), one_of_two)
    found.append({"what": "one of two processes", **by_two})
    with cluster_of(2) as cluster:

        def a_worker() -> None:
            """Of the cluster."""
            os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)

        by_dask = killed(
            study, lambda folder: run_study(study, folder, WorkerPool(1, cluster.scheduler_address)), a_worker
        )
        found.append({"what": "one of two Dask workers", **by_dask})
    command: list[Any] = []

    def in_a_process(folder: Path) -> None:
        """The study by a process that is killed."""
        command.append(spawn.Process(target=run_study, args=(study, folder, WorkerPool(1))))
        command[0].start()
        command[0].join()

    whole = killed(study, in_a_process, lambda: command[0].kill())
    found.append({"what": "the whole command, started again", **whole})
    return found


def row(found: dict[str, Any], first: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    over = [f"{found[name]:.1%}" if name in found else "" for name in ("overhead", "processor_overhead")]
    times = f"{found['wall_s']:.1f}", f"{found['processor_s']:.1f}"
    same = "the same" if found["numbers"] == first["numbers"] else "OTHERS"
    return found["way"], *times, *over, f"{found['peak_bytes'] / 1e6:.0f}", same


def killed_row(found: dict[str, Any], first: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `KILLED_HEAD`."""
    same = "the same" if found["numbers"] == first["numbers"] else "OTHERS"
    return found["what"], same, f"{found['there']} of {found['of']}", str(found["again"])


def compared(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Medians by way, Dask's beside those of two processes in the same round."""
    rounds: dict[str, list[dict[str, Any]]] = {}
    for each in rows:
        rounds.setdefault(each["way"], []).append(each)
    out = []
    for way, of in rounds.items():
        assert len({each["numbers"] for each in of}) == 1
        found = {**of[0], **{name: median(each[name] for each in of) for name in ("wall_s", "processor_s")}}
        if way.startswith("Dask"):
            beside = rounds["2 processes"]
            for name, field in (("overhead", "wall_s"), ("processor_overhead", "processor_s")):
                found[name] = median(d[field] / p[field] for d, p in zip(of, beside, strict=True)) - 1
        out.append(found)
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
            with cluster_of(workers) if is_dask else nullcontext() as cluster:
                rows.append(measured(name, workers, cluster, asked.trials))
                print(rows[-1], flush=True)
    many = measured("1 process", 1, None, asked.many) if asked.many else None
    found, dead = compared(rows), kills(asked.killed)
    print(table(HEAD, [row(each, found[0]) for each in found]))
    print(table(KILLED_HEAD, [killed_row(each, dead[0]) for each in dead]))
    sizes = {"trials": asked.trials, "killed_trials": asked.killed, "many_trials": asked.many, "many": many}
    write("cluster", {**sizes, "rows": found, "all": rows, "killed": dead})


if __name__ == "__main__":
    main(sys.argv[1:])
