"""Tests of interrupted `import` and `simulate`: no partial result is left, and the next command succeeds."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from basecal.cell.files import read_recording
from basecal.cell.journal import completing, recording_file
from basecal.cli import main
from basecal.geometry import SE3


def cut_at(monkeypatch: pytest.MonkeyPatch, writer: ModuleType, sample: int) -> None:
    """Interrupt the writing of a recording at a sample."""
    whole, done = recording_file.sample_line, count()

    def line(each):
        if next(done) == sample:
            raise KeyboardInterrupt
        return whole(each)

    monkeypatch.setattr(writer, "sample_line", line)


def words(folder: Path) -> list[str]:
    """Import of four poses of each stream, too few for a check of conventions."""
    options = []
    for seed, name in enumerate(("eye-base-from-flange", "hand-base-from-flange", "camera-from-target")):
        poses = SE3.exp(np.random.default_rng(seed).normal(size=(4, 6)))
        np.savetxt(folder / f"{name}.txt", poses.matrix.reshape(-1, 4))
        options += [f"--{name}", str(folder / f"{name}.txt")]
    return ["import", "poses", str(folder / "cell"), "--length-unit", "m", *options]


def test_interrupted_import_leaves_no_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No sample is left that could be calibrated as complete, and the same import is accepted again."""
    with monkeypatch.context() as patched:
        cut_at(patched, completing, 2)
        assert main(words(tmp_path)) == 130
    assert not (tmp_path / "cell" / "recording" / "samples.jsonl").exists()
    assert main(["calibrate", str(tmp_path / "cell")]) == 3
    assert main(words(tmp_path)) == 0
    assert len(read_recording(tmp_path / "cell").samples) == 4


def test_import_fills_an_empty_recording(tmp_path: Path) -> None:
    """`new` makes such a recording."""
    assert main(["new", str(tmp_path / "cell"), "--target", "pose"]) == 0
    assert main(words(tmp_path)) == 0
    assert len(read_recording(tmp_path / "cell").samples) == 4


def test_interrupted_simulation_leaves_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No file is left, and the same simulation is accepted again."""
    with monkeypatch.context() as patched:
        cut_at(patched, recording_file, 3)
        assert main(["simulate", str(tmp_path / "cell"), "--samples", "5"]) == 130
    assert list(tmp_path.iterdir()) == []
    assert main(["simulate", str(tmp_path / "cell"), "--samples", "5"]) == 0
