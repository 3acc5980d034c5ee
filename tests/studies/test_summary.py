"""What a study says of each point."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from basecal.studies.jobs import WorkerPool
from basecal.studies.run import run_study
from basecal.studies.summary import summarise
from basecal.studies.table import results
from study_example import SMALL, study


def test_quantities_are_those_of_the_trials(tmp_path: Path) -> None:
    """Quantiles, predicted sigmas, NEES and coverage as they are defined; JSON holds no NaN."""
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


def test_what_was_not_computed_is_null(tmp_path: Path) -> None:
    """The closed form has no sigmas; a point without answers has nothing but why."""
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
def test_predicted_sigmas_are_true(tmp_path: Path) -> None:
    """Mean NEES over 400 trials on 40 cells with robots' noise within 6 +- 0.7: 4 sigma of chance."""
    made = study(400, 40, hold=f"{SMALL}, robot_sigma_t_m: 1e-4, robot_sigma_r_rad: 1e-4")
    run_study(made, tmp_path / "out", WorkerPool(1))
    (point,) = summarise(made, tmp_path / "out")["points"]
    assert point["solved"] == 400
    assert abs(point["nees"]["mean"] - 6) < 0.7
    assert 0.91 < point["coverage"]["share"] < 0.99
