"""Jobs that do not depend on one another, done in this process, in processes of this machine or on a Dask cluster.

What a job gives is bytes, a function of the job alone; whoever asked keeps them. Neither how many work nor their order
nor their deaths change a byte. Moving work is left to `concurrent.futures` and to Dask.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait

from basecal.errors import BasecalError
from basecal.studies.cluster import called_on_cluster

_DEATHS = 3  # of processes that did one job and no other: it is not chance
Done = tuple["Job", bytes]
Step = Callable[[int, int], None]


@dataclass(frozen=True)
class Job:
    """A piece of work.

    Attributes:
        number: Which it is.
        size: Trials or cells in it, of which progress is reported.
        call: What gives its bytes, anywhere.
        killed: Its bytes where it kills whoever does it, from a text that says so; None if that ends everything.
    """

    number: int
    size: int
    call: partial[bytes]
    killed: Callable[[str], bytes] | None = None


@dataclass(frozen=True)
class WorkerPool:
    """The workers.

    Attributes:
        workers: Processes of this machine; with one, this one.
        scheduler: Address of a Dask scheduler, whose workers do it instead.
    """

    workers: int = 1
    scheduler: str | None = None


def work_jobs(
    jobs: Sequence[Job], workers: WorkerPool, total: int, keep: Callable[[Job, bytes], None], step: Step | None
) -> None:
    """Do jobs, keep what each gives, and report how much is done.

    Args:
        jobs: What is not done yet.
        workers: Who works.
        total: Size of all jobs, with those done before.
        keep: Called with each job and its bytes.
        step: Called with the size of what is done, and of all.

    Raises:
        BasecalError: as `done_jobs`.
    """
    notify = step or (lambda done, total: None)
    done = total - sum(job.size for job in jobs)
    notify(done, total)
    for job, content in done_jobs(jobs, workers):
        keep(job, content)
        done += job.size
        notify(done, total)


def done_jobs(jobs: Sequence[Job], workers: WorkerPool) -> Iterator[Done]:
    """Jobs with their bytes, as they are done.

    Raises:
        BasecalError: if a job kills whoever does it, and has no bytes for that; or the cluster cannot be reached.
    """
    if workers.scheduler is not None:
        for place, content in called_on_cluster(workers.scheduler, [job.call for job in jobs]):
            job = jobs[place]
            yield job, _killed_bytes(job, content) if isinstance(content, str) else content
    elif workers.workers == 1:
        yield from ((job, job.call()) for job in jobs)
    else:
        yield from _run_in_processes(jobs, workers.workers)


def _run_in_processes(jobs: Iterable[Job], workers: int) -> Iterator[Done]:
    left = {job.number: job for job in jobs}
    while left:
        try:
            with _pool(min(workers, len(left))) as pool:
                for job, content in _as_completed({pool.submit(job.call): job for job in left.values()}):
                    del left[job.number]
                    yield job, content
        except BrokenProcessPool:
            # Jobs are begun in their order: one of the first that are left was at work in the process that died.
            for job in list(left.values())[: workers + 1]:
                del left[job.number]
                yield job, _run_in_one_process(job)


def _run_in_one_process(job: Job) -> bytes:
    """A job's bytes by a process that does nothing else."""
    for _ in range(_DEATHS):
        try:
            with _pool(1) as pool:
                return pool.submit(job.call).result()
        except BrokenProcessPool:
            continue
    return _killed_bytes(job, f"the process that worked on it was killed {_DEATHS} times: is there memory enough?")


def _killed_bytes(job: Job, cause: str) -> bytes:
    if job.killed is None:
        raise BasecalError(f"part {job.number} cannot be finished: {cause}")
    return job.killed(cause)


def _as_completed(waiting: dict[Future[bytes], Job]) -> Iterator[Done]:
    """Jobs as they are done, their bytes held no longer than it takes to hand them on."""
    for future in as_completed(list(waiting)):
        yield waiting.pop(future), future.result()


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with this one; what they are at is not waited for where this ends early."""
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _watch_parent)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def _watch_parent() -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End where the process that asks is gone: nobody would take what this one makes."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
