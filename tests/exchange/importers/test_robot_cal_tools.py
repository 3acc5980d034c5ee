"""Tests of `basecal import robot-cal-tools`."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main

DATA = Path(os.environ.get("BASECAL_DATA", Path(__file__).parents[4] / "shared" / "data"))


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="the project's shared data are not here")
def test_real_robot_cal_tools_data_set_is_imported(tmp_path: Path) -> None:
    """Poses and images of a real set in the layout of robot_cal_tools are read back as recorded."""
    real = read_recording(DATA / "rct_10x10")
    (tmp_path / "poses").mkdir()
    listing = ""
    for sample in real.samples:
        pose = sample.robots["arm"].base_from_flange
        assert pose is not None
        values = zip(("x", "y", "z", "qx", "qy", "qz", "qw"), [*pose.translation, *pose.quaternion], strict=True)
        (tmp_path / "poses" / f"{sample.sample}.yaml").write_text("".join(f"{k}: {float(v)!r}\n" for k, v in values))
        image = DATA / "rct_10x10" / sample.images["cam"]
        shutil.copy(image, tmp_path / image.name)
        listing += f"- image: {image.name}\n  pose: poses/{sample.sample}.yaml\n"
    (tmp_path / "cal_data.yaml").write_text(listing)
    (tmp_path / "target.yaml").write_text(
        "target_finder: {type: ModifiedCircleGridTargetFinder, rows: 10, cols: 10, spacing: 0.0254}\n"
    )
    (tmp_path / "lens.yaml").write_text("intrinsics: {fx: 550.0, fy: 550.0, cx: 320.0, cy: 240.0}\n")
    words = ["import", "robot-cal-tools", str(tmp_path / "c"), str(tmp_path / "cal_data.yaml"), "--camera-on", "robot"]
    assert (
        main([*words, "--intrinsics", str(tmp_path / "lens.yaml"), "--target-file", str(tmp_path / "target.yaml")]) == 0
    )
    cell, recording = read_cell(tmp_path / "c"), read_recording(tmp_path / "c")
    assert cell.targets["target"].target is not None
    assert len(recording.samples) == len(real.samples)
    for got, want in zip(recording.samples, real.samples, strict=True):
        here, there = got.robots["eye"].base_from_flange, want.robots["arm"].base_from_flange
        assert here is not None
        assert there is not None
        np.testing.assert_allclose(here.matrix, there.matrix, atol=1e-12)
        assert (tmp_path / "c" / got.images["camera"]).stat().st_size > 0
