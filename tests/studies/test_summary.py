"""Tests of the summary and the table of a study."""

from __future__ import annotations

import csv
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.studies import summary as module
from basecal.studies.chunk import COLUMNS, Trials, chunk_path
from basecal.studies.jobs import WorkerPool
from basecal.studies.run import run_study
from basecal.studies.study import Study
from basecal.studies.summary import _point_summary, results, summarise, write_table
from study_example import SMALL, study


def test_summary_statistics_match_trials(tmp_path: Path) -> None:
    """Quantiles, predicted sigmas, NEES and coverage follow their definitions; the JSON has no NaN."""
    made = study(trials=12, hold=SMALL)
    run_study(made, tmp_path / "out", WorkerPool(1))
    summary = summarise(made, tmp_path / "out")
    trials = next(results(made, tmp_path / "out"))[1].trials
    (point,) = summary["points"]
    assert point["error_mm"]["median"] == pytest.approx(np.median(trials.error_mm))
    assert point["sigma_deg"] == pytest.approx(np.sqrt(np.mean(trials.sigma_deg**2)))
    assert point["nees"]["mean"] == pytest.approx(trials.nees.mean())
    assert point["nees"]["expected"] == 6
    assert point["nees"]["standard_error"] == pytest.approx(trials.nees.std(ddof=1) / np.sqrt(12))
    assert point["coverage"]["share"] == np.mean(trials.nees < 12.591587243743977)  # of chi-square with 6, at 95 %
    json.dumps(summary, allow_nan=False)


def test_missing_quantities_are_null(tmp_path: Path) -> None:
    """The closed form has no sigmas. A point without answers has only its reasons."""
    made = study(trials=2, hold=f"{SMALL}, layout: shifts", axes="solver: [closed_form]")
    run_study(made, tmp_path / "out", WorkerPool(1))
    (point,) = summarise(made, tmp_path / "out")["points"]
    assert (point["sigma_mm"], point["nees"], point["coverage"]) == (None, None, None)
    assert point["error_mm"]["rms"] > 0
    made = study(trials=2, hold=f"{SMALL}, layout: eye_in_hand, arms: halves")
    run_study(made, tmp_path / "none", WorkerPool(1))
    (point,) = summarise(made, tmp_path / "none")["points"]
    assert (point["solved"], point["error_mm"], point["nees"]) == (0, None, None)
    assert "needs two robots" in point["reasons"][0]


@pytest.mark.slow
def test_predicted_sigmas_are_calibrated(tmp_path: Path) -> None:
    """The mean NEES over 400 trials on 40 cells with robot noise is within 6 +- 0.7: 4 sigma of chance."""
    made = study(400, 40, hold=f"{SMALL}, robot_sigma_t_m: 1e-4, robot_sigma_r_rad: 1e-4")
    run_study(made, tmp_path / "out", WorkerPool(1))
    (point,) = summarise(made, tmp_path / "out")["points"]
    assert point["solved"] == 400
    assert abs(point["nees"]["mean"] - 6) < 0.7
    assert 0.91 < point["coverage"]["share"] < 0.99


@pytest.fixture(scope="module")
def study_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path]:
    study_ = study(trials=4, hold=f"layout: shifts, {SMALL}", axes="shift_m: [0.1, 0.2], solver: [closed_form]")
    folder = tmp_path_factory.mktemp("table") / "out"
    run_study(study_, folder, WorkerPool(1))
    return study_, folder


def test_parquet_contains_all_trials(study_run: tuple[Study, Path]) -> None:
    """The axes come first. Quantities that the solver does not give are missing values."""
    pq = pytest.importorskip("pyarrow.parquet")
    found = pq.read_table(write_table(*study_run))
    assert found.column_names == ["shift_m", "solver", *COLUMNS]
    assert found.column("shift_m").to_pylist() == [0.1] * 4 + [0.2] * 4
    expected = np.concatenate([result.trials.error_mm for _, result in results(*study_run)])
    assert np.array_equal(found.column("error_mm").to_numpy(), expected)
    assert found.column("sigma_mm").null_count == 8


def test_csv_is_written_without_pyarrow(study_run: tuple[Study, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """CSV has the same numbers to the last digit, and empty fields for missing values."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    path = write_table(*study_run)
    assert path.name == "table.csv"
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    expected = np.concatenate([result.trials.error_mm for _, result in results(*study_run)])
    assert [float(row["error_mm"]) for row in rows] == expected.tolist()
    assert {row["sigma_mm"] for row in rows} == {""}
    assert not list(path.parent.glob(".*"))


def test_table_is_independent_of_batch_size(study_run: tuple[Study, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """The table is the same for any number of rows in memory."""
    pq = pytest.importorskip("pyarrow.parquet")
    whole = pq.read_table(write_table(*study_run))
    monkeypatch.setattr(module, "_ROWS", 1)
    assert pq.read_table(write_table(*study_run)).equals(whole)


def test_missing_chunk_is_reported(study_run: tuple[Study, Path], tmp_path: Path) -> None:
    """No partial table is written."""
    assert chunk_path(study_run[1], study_run[0].chunks[0]).exists()
    with pytest.raises(InputError, match="lacks the trials of chunk 0"):
        write_table(study_run[0], tmp_path)
    assert list(tmp_path.iterdir()) == []


def trials(nees: list[float], solved: list[bool], directions: int = 6) -> Trials:
    """Trials with errors of 1, 2, ... mm, and twice as many degrees."""
    count = len(nees)
    numbers = np.arange(1.0, count + 1)
    whole = np.zeros(count, dtype=np.int64)
    sigmas = np.full(count, 2.0), np.full(count, 3.0)
    return Trials(
        whole,
        whole,
        whole,
        numbers,
        2 * numbers,
        *sigmas,
        np.array(nees),
        whole + directions,
        np.array(solved),
        numbers,
    )


def point_summary(*given: object) -> dict[str, object]:
    (point,) = study(hold=SMALL).points
    return _point_summary(point, trials(*given), ["why"])


def test_only_solved_trials_count() -> None:
    """Statistics are those of solved trials, except for time and number."""
    found = point_summary([1.0, 12.5, 12.7, 99.0], [True, True, True, False])
    assert (found["trials"], found["solved"], found["reasons"]) == (4, 3, ["why"])
    assert found["error_mm"]["rms"] == pytest.approx(np.sqrt(14 / 3))
    assert found["error_deg"]["median"] == 4
    assert (found["sigma_mm"], found["sigma_deg"], found["time_s"]) == (2.0, 3.0, 2.5)
    assert found["nees"]["mean"] == pytest.approx(26.2 / 3)
    assert found["nees"]["expected"] == 6
    assert found["coverage"] == {"share": pytest.approx(2 / 3), "expected": 0.95}


def test_single_trial_has_no_standard_error() -> None:
    """Two trials have a standard error. Without directions or without a solution there is no NEES at all."""
    assert point_summary([3.0], [True])["nees"] == {"mean": 3.0, "expected": 6, "standard_error": None}
    assert point_summary([3.0, 5.0], [True, True])["nees"]["standard_error"] == pytest.approx(1.0)
    for found in (point_summary([3.0], [True], 0), point_summary([3.0], [False])):
        assert (found["nees"], found["coverage"]) == (None, None)
    assert point_summary([3.0], [False])["error_mm"] is None


def test_coverage_depends_on_number_of_directions() -> None:
    """A squared error of 8 is within 95 % for six directions and beyond it for three."""
    assert point_summary([8.0], [True], 6)["coverage"]["share"] == 1
    assert point_summary([8.0], [True], 3)["coverage"]["share"] == 0


def test_unknown_sigmas_have_no_root_mean_square() -> None:
    made = trials([1.0, 1.0], [True, True])
    made.sigma_mm[1] = np.nan
    assert _point_summary(study(hold=SMALL).points[0], made, [])["sigma_mm"] is None
