"""A study worked through, here or on a cluster; what is done is kept, and not done again.

Chunks are the study's own, each is a function of the study alone, and its file is written whole or not at all.
"""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path

from basecal.cell.format.writing import is_unused, make_folder, write_atomically
from basecal.errors import InputError
from basecal.studies.chunk import keep_chunk, pack_result, read_chunk, work_chunk
from basecal.studies.jobs import Job, Step, WorkerPool, work_jobs
from basecal.studies.study import Study
from basecal.studies.study_file import read_study, study_from_text

STUDY = "study.yaml"
_read_study = lru_cache(maxsize=2)(study_from_text)


def run_study(study: Study, folder: Path, workers: WorkerPool, step: Step | None = None) -> None:
    """Do what of a study is not done yet; its chunks stand in a folder then.

    Args:
        study: The study.
        folder: Where its chunks are, or will be.
        workers: Who works.
        step: Called with the trials done and all.

    Raises:
        InputError: if the folder holds another study, or cannot be written, or the cluster is not there.
        BasecalError: if a chunk kills the processes that work on it.
    """
    _claim(study, folder)
    total = sum(chunk.trials for chunk in study.chunks)
    left = [chunk for chunk in study.chunks if read_chunk(folder, study, chunk) is None]
    jobs = [Job(chunk.index, chunk.trials, partial(run_chunk, study.text, chunk.index)) for chunk in left]
    work_jobs(jobs, workers, total, lambda job, content: keep_chunk(folder, study.chunks[job.number], content), step)


def _claim(study: Study, folder: Path) -> None:
    """Have the study's file in its folder."""
    path = folder / STUDY
    make_folder(folder)
    if path.exists():
        there = read_study(path)
        if there.identity != study.identity:
            raise InputError(f"{folder} holds another study ({STUDY} there differs): choose another folder with -o")
    elif not is_unused(folder):
        raise InputError(f"{folder} holds other files and no study: choose another folder with -o")
    write_atomically(path, study.text)


def run_chunk(text: str, index: int) -> bytes:
    """Result of a chunk of the study that a text describes, as its file keeps it."""
    study = _read_study(text, STUDY)
    return pack_result(study, work_chunk(study, study.chunks[index]))
