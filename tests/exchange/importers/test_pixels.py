"""Tests of `basecal import pixels`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_recording
from basecal.cli import main
from pose_files import options, pose_files


def test_pixels_are_added_to_samples(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Pixels are added to the robots' poses of their sample.

    Without a cell that describes the target they are refused.
    """
    (tmp_path / "p.csv").write_text("sample,id,u,v\n0,0,10,20\n0,1,30,40\n3,2,50,60\n")
    files = pose_files(tmp_path)
    del files["camera-from-target"]
    words = ["import", "pixels", str(tmp_path / "c"), str(tmp_path / "p.csv"), *options(files), "--length-unit", "m"]
    assert main(words) == 3
    assert "basecal new" in capsys.readouterr().err
    main(["new", str(tmp_path / "c")])
    assert main([*words, "--sigma-px", "0.3"]) == 0
    samples = read_recording(tmp_path / "c").samples
    assert [len(sample.observations) for sample in samples] == [1, 0, 0, 1]
    np.testing.assert_array_equal(samples[0].observations[0].pixels, [[10, 20], [30, 40]])
    np.testing.assert_array_equal(samples[0].observations[0].sigma_px, [0.3, 0.3])
    np.testing.assert_array_equal(samples[3].observations[0].ids, [2])
