"""Tests of `basecal report` of valid and damaged runs."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from shutil import copytree

import numpy as np
import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.stages.solving import screen_conventions
from basecal.cell.calibration import Calibration
from basecal.cell.files import latest_run, write_calibration
from basecal.cli import main
from torment.damage import damaged

no_conventions = without_stages(screen_conventions)

MUTANTS = 15


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Calibrated cell with one of most kinds of results."""
    folder = tmp_path_factory.mktemp("calibrated") / "cell"
    assert main(["simulate", str(folder), "--samples", "8", "--target", "led", "--mounts", "prior"]) == 0
    assert main(["calibrate", str(folder)]) in (0, 1)
    return folder


def test_refused_run_is_reported(calibrated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A run without transforms is reported as refused, not as unreadable."""
    folder = copytree(calibrated, tmp_path / "cell")
    write_calibration(Calibration("refused", joint_covariance=np.zeros((0, 0))), folder)
    capsys.readouterr()
    assert main(["report", str(folder)]) == 4
    assert "REFUSED" in capsys.readouterr().out


@pytest.mark.journey
def test_damaged_results_are_reported_or_refused(
    calibrated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever calibration.json contains, the result is a report or one line of error."""
    folder = copytree(calibrated, tmp_path / "cell")
    path = latest_run(folder) / "calibration.json"
    good = json.loads(path.read_text())
    codes = []
    for seed in range(MUTANTS):
        path.write_text(json.dumps(damaged(good, Random(seed), faults=1)))
        capsys.readouterr()
        codes.append(main(["report", str(folder)]))
        said = capsys.readouterr()
        assert codes[-1] != 3 or said.err.count("\n") == 1, seed
    assert {0, 1, 3} >= set(codes) > {3}
