"""A study worked through by processes of this machine; what is done is kept, and not done again.

Chunks are the study's own, each is a function of the study alone, and a process writes its chunk's file whole or not
at all: neither the number of processes nor their order nor their deaths change a number.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from pathlib import Path

from basecal.cell.format.writing import make_folder, write_whole
from basecal.errors import BasecalError, InputError
from basecal.studies.chunk import read_chunk, worked, write_chunk
from basecal.studies.study import Chunk, Study
from basecal.studies.study_file import read_study, study_from_text

STUDY = "study.yaml"
_DEATHS = 3  # of processes one after the other without a chunk done: it is not chance
Step = Callable[[int, int], None]


def run_study(study: Study, folder: Path, workers: int, step: Step | None = None) -> None:
    """Do what of a study is not done yet; its chunks stand in a folder then.

    Args:
        study: The study.
        folder: Where its chunks are, or will be.
        workers: How many processes; with one, this one.
        step: Called with the trials done and all.

    Raises:
        InputError: if the folder holds another study, or cannot be written, or processes die again and again.
    """
    tell = step or (lambda done, total: None)
    _claim(study, folder)
    total = sum(chunk.trials for chunk in study.chunks)
    left = [chunk for chunk in study.chunks if read_chunk(folder, study, chunk) is None]
    done = total - sum(chunk.trials for chunk in left)
    tell(done, total)
    deaths = 0
    while left:
        finished = set()
        try:
            for chunk in _finished(study, folder, left, workers):
                finished.add(chunk.index)
                done += chunk.trials
                tell(done, total)
        except BrokenProcessPool:
            deaths = 0 if finished else deaths + 1
            if deaths == _DEATHS:
                raise BasecalError(
                    f"a process of the study was killed {_DEATHS} times without finishing a chunk: is there memory "
                    "enough? Try --workers 1"
                ) from None
        left = [chunk for chunk in left if chunk.index not in finished and read_chunk(folder, study, chunk) is None]


def _claim(study: Study, folder: Path) -> None:
    """Have the study's file in its folder."""
    path = folder / STUDY
    make_folder(folder)
    if path.exists():
        there = read_study(path)
        if there.identity != study.identity:
            raise InputError(f"{folder} holds another study ({STUDY} there differs): choose another folder with -o")
    elif any(folder.iterdir()):
        raise InputError(f"{folder} holds other files and no study: choose another folder with -o")
    write_whole(path, study.text)


def _finished(study: Study, folder: Path, left: Iterable[Chunk], workers: int) -> Iterable[Chunk]:
    """Chunks as they are done."""
    if workers == 1:
        for chunk in left:
            write_chunk(folder, study, chunk, worked(study, chunk))
            yield chunk
        return
    of_index = {chunk.index: chunk for chunk in left}
    with ProcessPoolExecutor(workers, get_context("spawn"), _begin, (study.text, str(folder))) as pool:
        waiting = [pool.submit(_work, index) for index in of_index]
        try:
            for future in as_completed(waiting):
                yield of_index[future.result()]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


class _Own:
    """What a process of the study works on."""

    study: Study
    folder: Path


def _begin(text: str, folder: str) -> None:
    _Own.study, _Own.folder = study_from_text(text, STUDY), Path(folder)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End where the process that asks is gone: nobody would take what this one makes."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _work(index: int) -> int:
    chunk = _Own.study.chunks[index]
    write_chunk(_Own.folder, _Own.study, chunk, worked(_Own.study, chunk))
    return index
