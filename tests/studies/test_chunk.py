"""Tests of the chunks of a study: computing, storing and reading them."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from basecal.geometry import SE3
from basecal.studies import chunk as module
from basecal.studies.chunk import COLUMNS, chunk_path, compute_chunk, pack_result, read_chunk, store_chunk
from basecal.studies.solvers.solver import Answers
from study_example import BOARD, SMALL, study


def test_chunk_is_deterministic() -> None:
    """A chunk computed twice has the same numbers to the last digit, except for times."""
    made = study(hold=SMALL)
    first, again = (compute_chunk(made, made.chunks[0]).trials for _ in range(2))
    for name in set(COLUMNS) - {"time_s"}:
        assert np.array_equal(getattr(first, name), getattr(again, name)), name


def test_trial_errors_and_nees(monkeypatch: pytest.MonkeyPatch) -> None:
    """An answer that is off by 3 mm and 2 deg with sigmas of 1 mm and 1 deg per axis has a NEES of 9 + 4.

    A trial without a solution has NaN.
    """
    made = study(trials=2, cells=1, hold=SMALL)
    degree = np.radians(1.0)

    class Off:
        """Solver with known errors."""

        @staticmethod
        def solve(draws):
            """Truth moved by a known error."""
            off = SE3.exp([0.003, 0, 0, 0, 0, 0]) @ SE3.exp([0, 0, 0, 0, 2 * degree, 0])
            covariance = np.diag([1e-6] * 3 + [degree**2] * 3)
            moved = SE3.stack([draws.truth @ off.inverse()] * 2)
            return Answers(moved, np.stack([covariance] * 2), np.array([True, False]), "no more")

    monkeypatch.setattr(module, "SOLVERS", dict.fromkeys(module.SOLVERS, Off))
    result = compute_chunk(made, made.chunks[0])
    trials = result.trials
    assert trials.error_mm[0] == pytest.approx(3, rel=1e-3)
    assert trials.error_deg[0] == pytest.approx(2, rel=1e-6)
    assert trials.sigma_mm[0] == pytest.approx(np.sqrt(3))
    assert trials.sigma_deg[0] == pytest.approx(np.sqrt(3))
    assert trials.nees[0] == pytest.approx(13, rel=1e-3)
    assert np.isnan([trials.error_mm[1], trials.sigma_mm[1], trials.nees[1]]).all()
    assert result.reasons == ("no more",)


def test_failed_simulation_has_a_reason() -> None:
    """The trials of a cell that cannot be simulated have no answer, and the study continues."""
    made = study(trials=3, cells=1, hold=f"{SMALL}, layout: eye_in_hand, arms: halves")
    result = compute_chunk(made, made.chunks[0])
    assert not result.trials.solved.any()
    assert "needs two robots" in result.reasons[0]


@pytest.mark.journey
def test_damaged_chunk_file_is_ignored(tmp_path: Path) -> None:
    """A stored chunk is read exactly. A file that is damaged, truncated or of another study is ignored."""
    made = study(hold=SMALL)
    chunk = made.chunks[0]
    assert read_chunk(tmp_path, made, chunk) is None
    result = compute_chunk(made, chunk)
    store_chunk(tmp_path, chunk, pack_result(made, result))
    again = read_chunk(tmp_path, made, chunk)
    assert all(np.array_equal(getattr(again.trials, n), getattr(result.trials, n), equal_nan=True) for n in COLUMNS)
    assert read_chunk(tmp_path, dataclasses.replace(made, seed=1), chunk) is None
    path = chunk_path(tmp_path, chunk)
    whole = path.read_bytes()
    about = np.frombuffer(json.dumps({"study": made.identity, "reasons": []}).encode(), dtype=np.uint8)
    columns = vars(result.trials) | {"solved": result.trials.solved.astype(np.uint8)}
    for other in (
        {"about": about, **columns, "nees": columns["nees"][1:]},
        {"about": about, **columns, "nees": np.array("many")},
        {"about": about[1:], **columns},
        {"about": np.frombuffer(b"[]", dtype=np.uint8), **columns},
        columns,
        {"about": about, **columns, "more": np.zeros(2**24 + 1)},  # a megabyte compressed to a kilobyte
    ):
        np.savez_compressed(path, **other)
        assert read_chunk(tmp_path, made, chunk) is None
    for damaged in (b"", whole[: len(whole) // 2], b"PK" + bytes(100), whole[:200] + b"\xff" * 40 + whole[240:]):
        path.write_bytes(damaged)
        assert read_chunk(tmp_path, made, chunk) is None


def test_batch_time_is_divided_among_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 6 s for three trials each has 2 s, also without an answer."""
    clock = iter((10.0, 16.0))
    monkeypatch.setattr(module.time, "perf_counter", lambda: next(clock))
    made = study(trials=3, cells=1, hold=f"{SMALL}, layout: eye_in_hand, arms: halves")
    trials = compute_chunk(made, made.chunks[0]).trials
    assert trials.time_s.tolist() == [2.0] * 3
    assert np.isnan([trials.sigma_mm, trials.sigma_deg, trials.nees, trials.error_mm]).all()
    assert trials.directions.tolist() == [0] * 3
    assert trials.trial.tolist() == [0, 1, 2]


def test_trials_are_assigned_to_cells() -> None:
    """Three trials on two cells are two of the first cell and one of the second. Equal reasons are stored once."""
    made = study(trials=3, cells=2, hold=f"{BOARD}, layout: eye_in_hand, arms: halves", axes="samples: [5, 6]")
    result = compute_chunk(made, made.chunks[1])
    assert result.trials.cell.tolist() == [0, 0, 1]
    assert result.trials.trial.tolist() == [0, 1, 2]
    assert result.trials.point.tolist() == [1] * 3
    assert len(result.reasons) == 1
    assert chunk_path(Path("a"), made.chunks[1]) == Path("a/chunks/000001.npz")
