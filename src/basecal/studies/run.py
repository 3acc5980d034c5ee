"""Execution of a study, locally or on a cluster; finished chunks are stored and not repeated.

The study alone determines its chunks and their results. The file of a chunk is written atomically.
"""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path

from basecal.cell.format.writing import is_unused, make_folder, write_atomically
from basecal.errors import InputError
from basecal.studies.chunk import compute_chunk, pack_result, read_chunk, store_chunk
from basecal.studies.jobs import Job, Progress, WorkerPool, run_jobs
from basecal.studies.study import Study
from basecal.studies.study_file import read_study, study_from_text

STUDY = "study.yaml"
_read_study = lru_cache(maxsize=2)(study_from_text)


def run_study(study: Study, folder: Path, workers: WorkerPool, progress: Progress | None = None) -> None:
    """Compute the missing chunks of a study, and store them in a folder.

    Args:
        study: The study.
        folder: The folder of the chunks.
        workers: The workers.
        progress: Receives the number of finished trials and the total number.

    Raises:
        InputError: if the folder has another study or cannot be written, or the cluster cannot be reached.
        BasecalError: if a chunk kills its worker processes.
    """
    _claim(study, folder)
    total = sum(chunk.trials for chunk in study.chunks)
    remaining = [chunk for chunk in study.chunks if read_chunk(folder, study, chunk) is None]
    jobs = [Job(chunk.index, chunk.trials, partial(run_chunk, study.text, chunk.index)) for chunk in remaining]
    run_jobs(
        jobs, workers, total, lambda job, content: store_chunk(folder, study.chunks[job.number], content), progress
    )


def _claim(study: Study, folder: Path) -> None:
    """Write the study's file to its folder, and check that the folder has no other study or files."""
    path = folder / STUDY
    make_folder(folder)
    if path.exists():
        stored = read_study(path)
        if stored.identity != study.identity:
            raise InputError(f"{folder} holds another study ({STUDY} there differs): choose another folder with -o")
    elif not is_unused(folder):
        raise InputError(f"{folder} holds other files and no study: choose another folder with -o")
    write_atomically(path, study.text)


def run_chunk(text: str, index: int) -> bytes:
    """Compute a chunk of the study in a YAML text; the content of the chunk's file."""
    study = _read_study(text, STUDY)
    return pack_result(study, compute_chunk(study, study.chunks[index]))
