"""`basecal merge`: two recordings made apart calibrate as one."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.cell.files import read_recording
from basecal.cli import main


def test_two_simulated_recordings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two recordings of one cell are one of both, and it says what came from where."""
    for name in ("a", "b"):
        assert main(["simulate", str(tmp_path / name), "--samples", "6", "--target", "pose", "--seed", "3"]) == 0
    capsys.readouterr()
    assert main(["merge", str(tmp_path / "a"), str(tmp_path / "b"), "-o", str(tmp_path / "c")]) == 0
    said, following = capsys.readouterr()
    assert f"{tmp_path / 'b'}: 6 samples of eye, hand, from number 6 on" in said
    assert following.rstrip().endswith(f"basecal calibrate {tmp_path / 'c'}")
    assert [sample.sample for sample in read_recording(tmp_path / "c").samples] == list(range(12))


def test_one_cell_is_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two are needed."""
    assert main(["merge", str(tmp_path), "-o", str(tmp_path / "c")]) == 2
    assert "give two cells or more" in capsys.readouterr().err
