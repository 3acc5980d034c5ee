"""Tests of running studies: the same tables for any number of processes and after interruptions."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from basecal.errors import InputError
from basecal.studies import run as module
from basecal.studies.jobs import WorkerPool
from basecal.studies.run import run_study
from basecal.studies.study_file import study_from_text
from study_example import SMALL, numbers, study

AXES = "solver: [maximum_likelihood, opencv], samples: [6, 8]"
HOLD = f"{SMALL.removeprefix('samples: 8, ')}, layout: eye_in_hand, robot_sigma_t_m: 1e-4, robot_sigma_r_rad: 1e-4"


@pytest.mark.slow
def test_table_is_independent_of_number_of_processes(tmp_path: Path) -> None:
    """One and two processes give the same table to the last digit, except for times."""
    made = study(trials=60, hold=HOLD, axes=AXES)
    for workers in (1, 2):
        run_study(made, tmp_path / str(workers), WorkerPool(workers))
    assert numbers(made, tmp_path / "1") == numbers(made, tmp_path / "2")


@pytest.mark.journey
def test_interrupted_study_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A study that is interrupted after a chunk resumes with the second. Progress counts all trials that are done."""
    made = study(hold=SMALL, axes="pixel_px: [0.1, 0.2, 0.3]")
    work, done = module.compute_chunk, []

    def once(study, chunk):
        """Compute a chunk, and interrupt the second time."""
        if done:
            raise KeyboardInterrupt
        done.append(chunk.index)
        return work(study, chunk)

    monkeypatch.setattr(module, "compute_chunk", once)
    with pytest.raises(KeyboardInterrupt):
        run_study(made, tmp_path / "cut", WorkerPool(1))
    monkeypatch.setattr(module, "compute_chunk", lambda study, chunk: done.append(chunk.index) or work(study, chunk))
    steps: list[tuple[int, int]] = []
    run_study(made, tmp_path / "cut", WorkerPool(1), lambda *at: steps.append(at))
    assert done == [0, 1, 2]
    assert steps == [(8, 24), (16, 24), (24, 24)]
    run_study(made, tmp_path / "whole", WorkerPool(1))
    assert numbers(made, tmp_path / "cut") == numbers(made, tmp_path / "whole")


LONG = f"""schema: basecal/study/1
trials: 120
cells: 4
hold: {{{HOLD}}}
axes: {{samples: [6, 8, 10, 12, 14, 16]}}
"""


def start_study(file: Path, folder: Path) -> subprocess.Popen[bytes]:
    words = [sys.executable, "-m", "basecal", "study", str(file), "--workers", "2", "-o", str(folder)]
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def children(process: subprocess.Popen[bytes]) -> list[int]:
    """Worker processes of a process, on Linux."""
    ids = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    return [pid for pid in map(int, ids) if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]


def first_chunk(folder: Path) -> None:
    end = time.monotonic() + 60
    while not list(folder.glob("chunks/*.npz")):
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc")
@pytest.mark.parametrize("whom", ["a worker", "all"])
def test_killed_study_gives_the_same_table(tmp_path: Path, whom: str) -> None:
    """After kill -9 of a worker the study continues.

    After that of the command it is started again and keeps its chunks.
    """
    file, folder = tmp_path / "long.yaml", tmp_path / "out"
    file.write_text(LONG)
    process = start_study(file, folder)
    first_chunk(folder)
    workers = children(process)
    os.kill(workers[0] if whom == "a worker" else process.pid, signal.SIGKILL)
    if whom == "all":
        process.communicate(timeout=60)
        end = time.monotonic() + 30
        while any(Path(f"/proc/{pid}").exists() for pid in workers):  # no worker outlives the command
            assert time.monotonic() < end
            time.sleep(0.02)
        kept = {path.name: path.stat().st_mtime_ns for path in folder.glob("chunks/*.npz")}
        process = start_study(file, folder)
    _, stderr = process.communicate(timeout=120)
    assert process.returncode == 0, stderr
    made = study_from_text(LONG, "long.yaml")
    run_study(made, tmp_path / "whole", WorkerPool(1))
    assert numbers(made, folder) == numbers(made, tmp_path / "whole")
    if whom == "all":
        assert kept
        assert all((folder / "chunks" / name).stat().st_mtime_ns == at for name, at in kept.items())


def test_partial_file_of_killed_study_is_ignored(tmp_path: Path) -> None:
    """A partially written study file has a name of its own, and the same command continues."""
    (tmp_path / ".study.yaml.0123abcd.part").write_text("schema")
    run_study(study(trials=2, hold=SMALL), tmp_path, WorkerPool(1))
    assert (tmp_path / "study.yaml").is_file()


def test_folder_of_another_study_is_refused(tmp_path: Path) -> None:
    """A folder with another study, or other files, is refused and unchanged."""
    run_study(study(trials=2, hold=SMALL), tmp_path / "one", WorkerPool(1))
    with pytest.raises(InputError, match="holds another study"):
        run_study(study(trials=3, hold=SMALL), tmp_path / "one", WorkerPool(1))
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="holds other files"):
        run_study(study(trials=2, hold=SMALL), tmp_path / "notes", WorkerPool(1))
    assert [path.name for path in (tmp_path / "notes").iterdir()] == ["mine.txt"]
