"""`basecal import mrcal`."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.cell.files import read_cell
from basecal.cli import main
from lens_texts import CAMERAMODEL, tells_the_lens


def test_the_lens(tmp_path: Path) -> None:
    """A camera of a new cell has it."""
    assert tells_the_lens(tmp_path, "mrcal", "a.cameramodel", CAMERAMODEL)


def test_a_start_and_a_lens_without_an_equal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--status free` leaves the lens to be estimated; a splined model is refused, and nothing is made."""
    assert tells_the_lens(tmp_path, "mrcal", "a.cameramodel", CAMERAMODEL, "--status", "free")
    intrinsics = read_cell(tmp_path / "c").cameras["wrist"].intrinsics
    assert intrinsics is not None
    assert intrinsics.status == "free"
    path = tmp_path / "s.cameramodel"
    path.write_text(CAMERAMODEL.replace("LENSMODEL_OPENCV4", "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=20"))
    assert main(["import", "mrcal", str(tmp_path / "d"), str(path), "--on", "left"]) == 3
    assert "LENSMODEL_SPLINED" in capsys.readouterr().err
    assert not (tmp_path / "d").exists()
