"""Runs as they are named on the command line."""

from pathlib import Path

import pytest

from basecal.cell import Calibration
from basecal.cell.files import write_calibration
from basecal.cli.runs import find_run
from basecal.errors import InputError


def test_a_cell_is_its_latest_run(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text("")
    with pytest.raises(InputError, match="has no run yet: basecal calibrate"):
        find_run(tmp_path)
    run = write_calibration(Calibration("refused"), tmp_path).parent
    assert find_run(tmp_path) == run
    assert find_run(run) == run
    assert find_run(run / "calibration.json") == run / "calibration.json"
