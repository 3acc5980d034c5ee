"""Independent jobs, executed in this process, in processes of this machine or on a Dask cluster.

A job returns bytes that depend only on the job; the caller stores them. The number of workers, their order and their
crashes do not change the result. `concurrent.futures` and Dask distribute the jobs.
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
from basecal.studies.cluster import call_on_cluster

_MOST_CRASHES = 3  # crashes of processes with only this job, after which the job counts as the cause
Done = tuple["Job", bytes]
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Job:
    """A piece of work.

    Attributes:
        number: Number of the job.
        size: Number of trials or cells in the job, for reports of progress.
        call: Function that computes the result, as bytes.
        killed_result: Function from a message to the result if the job kills its worker; None to raise an error.
    """

    number: int
    size: int
    call: partial[bytes]
    killed_result: Callable[[str], bytes] | None = None


@dataclass(frozen=True)
class WorkerPool:
    """Workers that execute jobs.

    Attributes:
        workers: Number of processes on this machine; 1 for this process alone.
        scheduler: Address of a Dask scheduler, whose workers are used instead.
    """

    workers: int = 1
    scheduler: str | None = None


def run_jobs(
    jobs: Sequence[Job], workers: WorkerPool, total: int, store: Callable[[Job, bytes], None], progress: Progress | None
) -> None:
    """Execute jobs, store their results, and report the progress.

    Args:
        jobs: The remaining jobs.
        workers: The workers.
        total: Total size of all jobs, including those finished earlier.
        store: Receives each job and its result.
        progress: Receives the finished size and the total size.

    Raises:
        BasecalError: under the conditions of `finished_jobs`.
    """
    report = progress or (lambda done, total: None)
    done = total - sum(job.size for job in jobs)
    report(done, total)
    for job, content in finished_jobs(jobs, workers):
        store(job, content)
        done += job.size
        report(done, total)


def finished_jobs(jobs: Sequence[Job], workers: WorkerPool) -> Iterator[Done]:
    """Execute jobs; yield each job with its result when it is finished.

    Raises:
        BasecalError: if a job without `killed_result` kills its worker, or the cluster cannot be reached.
    """
    if workers.scheduler is not None:
        for index, content in call_on_cluster(workers.scheduler, [job.call for job in jobs]):
            job = jobs[index]
            yield job, _killed_job_result(job, content) if isinstance(content, str) else content
    elif workers.workers == 1:
        yield from ((job, job.call()) for job in jobs)
    else:
        yield from _run_in_processes(jobs, workers.workers)


def _run_in_processes(jobs: Iterable[Job], workers: int) -> Iterator[Done]:
    remaining = {job.number: job for job in jobs}
    while remaining:
        try:
            with _pool(min(workers, len(remaining))) as pool:
                for job, content in _as_completed({pool.submit(job.call): job for job in remaining.values()}):
                    del remaining[job.number]
                    yield job, content
        except BrokenProcessPool:
            # Jobs start in their order: one of the first remaining jobs was running in the process that died.
            for job in list(remaining.values())[: workers + 1]:
                del remaining[job.number]
                yield job, _run_in_one_process(job)


def _run_in_one_process(job: Job) -> bytes:
    """Execute a job in a process with no other jobs."""
    for _ in range(_MOST_CRASHES):
        try:
            with _pool(1) as pool:
                return pool.submit(job.call).result()
        except BrokenProcessPool:
            continue
    return _killed_job_result(
        job, f"the process that worked on it was killed {_MOST_CRASHES} times: is there enough memory?"
    )


def _killed_job_result(job: Job, cause: str) -> bytes:
    if job.killed_result is None:
        raise BasecalError(f"part {job.number} cannot be finished: {cause}")
    return job.killed_result(cause)


def _as_completed(waiting: dict[Future[bytes], Job]) -> Iterator[Done]:
    """Yield finished jobs with their results, without keeping the results in memory."""
    for future in as_completed(list(waiting)):
        yield waiting.pop(future), future.result()


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Context of a process pool that ends with this process; on an error, running jobs are not awaited."""
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
    """End this process when its parent process has ended."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
