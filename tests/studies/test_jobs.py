"""Tests of jobs run by worker processes that may die."""

from __future__ import annotations

import sys
from functools import partial

import pytest

from basecal.errors import BasecalError
from basecal.studies.jobs import Job, WorkerPool, finished_jobs, run_jobs
from job_examples import deadly, deadly_once, named, wrong

KILLS = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="kills a process")


def jobs(count: int, first: int = 0) -> list[Job]:
    return [Job(number, 1, partial(named, number)) for number in range(first, first + count)]


@pytest.mark.parametrize("workers", [1, 2])
def test_every_job_is_done_once(workers: int) -> None:
    """Every job is done once with its own bytes, in this process and in workers."""
    done = [(job.number, content) for job, content in finished_jobs(jobs(5), WorkerPool(workers))]
    assert sorted(done) == [(number, named(number)) for number in range(5)]


def test_progress_includes_earlier_work() -> None:
    """Progress is reported before the first job and after each, including work done earlier."""
    steps, kept = list[tuple[int, int]](), list[int]()
    few = [Job(number, size, partial(named, number)) for number, size in ((3, 2), (4, 5))]
    run_jobs(few, WorkerPool(), 10, lambda job, content: kept.append(job.number), lambda *step: steps.append(step))
    assert steps == [(3, 10), (5, 10), (10, 10)]
    assert kept == [3, 4]


@KILLS
@pytest.mark.slow
def test_deadly_job_gives_its_failure_result(tmp_path) -> None:
    """A job that kills its worker gives its own failure result. The other jobs are done."""
    bad = Job(0, 1, partial(deadly, 0), lambda why: f"gone: {why}".encode())
    done = {job.number: content for job, content in finished_jobs([bad, *jobs(3, 1)], WorkerPool(2))}
    assert b"killed 3 times" in done.pop(0)
    assert done == {number: named(number) for number in (1, 2, 3)}


@KILLS
@pytest.mark.slow
def test_deadly_job_without_failure_result_raises() -> None:
    """The error names the job."""
    with pytest.raises(BasecalError, match="part 7 cannot be finished: the process that worked on it was killed"):
        list(finished_jobs([Job(7, 1, partial(deadly, 7))], WorkerPool(2)))


@KILLS
@pytest.mark.slow
def test_job_of_dead_worker_is_repeated(tmp_path) -> None:
    """If a worker dies once, its job is done again."""
    once = Job(0, 1, partial(deadly_once, str(tmp_path / "mark"), 0))
    done = {job.number: content for job, content in finished_jobs([once, *jobs(4, 1)], WorkerPool(2))}
    assert done == {number: named(number) for number in range(5)}


@pytest.mark.parametrize("workers", [1, 2])
def test_job_error_is_raised_unchanged(workers: int) -> None:
    """An error of a job is raised unchanged."""
    with pytest.raises(ZeroDivisionError, match="job 3"):
        list(finished_jobs([Job(3, 1, partial(wrong, 3)), Job(4, 1, partial(wrong, 3))], WorkerPool(workers)))
