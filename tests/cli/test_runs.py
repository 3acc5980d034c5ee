"""Runs as they are named on the command line."""

from pathlib import Path

import pytest

from basecal.cell import Calibration
from basecal.cell.files import write_calibration
from basecal.cli.runs import run_of
from basecal.errors import InputError


def test_a_cell_is_its_latest_run(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text("")
    with pytest.raises(InputError, match="has no run yet: basecal calibrate"):
        run_of(tmp_path)
    run = write_calibration(Calibration("refused"), tmp_path).parent
    assert run_of(tmp_path) == run
    assert run_of(run) == run
    assert run_of(run / "calibration.json") == run / "calibration.json"
