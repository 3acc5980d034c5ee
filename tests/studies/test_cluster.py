"""Tests of studies on a Dask cluster: the same results as local processes, and one-line errors."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from basecal.errors import InputError, MissingExtra
from basecal.studies import cluster as module
from basecal.studies.cluster import call_on_cluster
from basecal.studies.jobs import Job, WorkerPool, finished_jobs
from basecal.studies.run import run_study
from job_examples import deadly, lacking, named, of_another_version
from study_example import SMALL, numbers, study


@contextmanager
def local_cluster(workers: int) -> Iterator[object]:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, dashboard_address=None, silence_logs="CRITICAL"
    ) as cluster:
        yield cluster


@pytest.mark.journey
def test_missing_scheduler_is_reported(monkeypatch) -> None:
    """The error is one line with the address and what to do."""
    pytest.importorskip("distributed")
    monkeypatch.setattr(module, "_PATIENCE_S", 0.2)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(InputError, match=f"no Dask scheduler answers at {address}.*dask scheduler"):
            list(call_on_cluster(address, []))
    with pytest.raises(InputError, match="no Dask scheduler answers at gossip://x"):
        list(call_on_cluster("gossip://x", []))


def test_missing_dask_names_the_extra(monkeypatch) -> None:
    """The error names the extra to install, as for other extras."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtra, match=r"pip install 'basecal\[cluster\]'"):
        list(call_on_cluster("tcp://127.0.0.1:1", []))


@pytest.mark.slow
def test_incompatible_workers_are_refused() -> None:
    """Workers of another version are refused before any job.

    A missing package is reported at the first call that needs it.
    """
    distributed = pytest.importorskip("distributed")
    with local_cluster(1) as cluster:
        with pytest.raises(InputError, match=r"a worker lacks a package .*no_such_package"):
            list(call_on_cluster(cluster.scheduler_address, [partial(lacking, 1)]))
        with distributed.Client(cluster.scheduler_address) as client:
            client.run(of_another_version)
        with pytest.raises(InputError, match=r"has basecal 0\.0\.0, here is .*: install the same version there"):
            list(call_on_cluster(cluster.scheduler_address, []))


@pytest.mark.slow
def test_job_that_kills_its_worker_is_abandoned() -> None:
    """Dask abandons the job after its first death.

    The other jobs are done, including those queued on the dead worker.
    """
    dask = pytest.importorskip("dask")
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}), local_cluster(2) as cluster:
        bad = Job(0, 1, partial(deadly, 0), lambda why: why.encode())
        rest = [Job(k, 1, partial(named, k)) for k in (1, 2, 3)]
        done = {
            job.number: content
            for job, content in finished_jobs([bad, *rest], WorkerPool(1, cluster.scheduler_address))
        }
    assert b"killed repeatedly" in done.pop(0)
    assert done == {number: named(number) for number in (1, 2, 3)}


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="kills a process")
@pytest.mark.parametrize("workers", [2, 4])
def test_table_is_independent_of_number_of_workers(tmp_path: Path, workers: int) -> None:
    """The table equals that of a local process to the last digit, except for times.

    With two workers, one of them is killed midway.
    """
    made = study(trials=80, cells=8, hold=SMALL, axes="pixel_px: [0.1, 0.2, 0.3], robot_sigma_t_m: [0, 1e-4, 2e-4]")
    with local_cluster(workers) as cluster:
        if workers == 2:
            threading.Thread(target=kill_after_a_chunk, args=(cluster, tmp_path / "dask"), daemon=True).start()
        run_study(made, tmp_path / "dask", WorkerPool(1, cluster.scheduler_address))
    run_study(made, tmp_path / "here", WorkerPool(1))
    assert numbers(made, tmp_path / "dask") == numbers(made, tmp_path / "here")


def kill_after_a_chunk(cluster, folder: Path) -> None:
    """Kill a worker with -9 once a chunk is stored."""
    end = time.monotonic() + 60
    while not list(folder.glob("chunks/*.npz")):
        assert time.monotonic() < end
        time.sleep(0.01)
    os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have another malloc")
def test_workers_keep_freed_memory() -> None:
    """By Dask's default each array of a megabyte maps new pages. With `_keep_memory` hardly any page faults occur."""
    code = """
import resource, threading
import numpy as np
from basecal.studies import cluster

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(100):
        np.ones(2**17).sum()
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

def work():
    before = faults()
    cluster._keep_memory()
    faults()
    print(before, faults())

thread = threading.Thread(target=work)
thread.start()
thread.join()
"""
    environment = {**os.environ, "MALLOC_TRIM_THRESHOLD_": "65536"}
    made = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    before, after = map(int, made.stdout.split())
    assert before > 10_000
    assert after < 1000
