"""Tests of `basecal merge`: two separate recordings calibrate as one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from basecal.cell import Finding, Recording, RobotState, Sample
from basecal.cell.files import read_recording
from basecal.cli import main
from basecal.cli.merge import merge


def test_two_simulated_recordings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two recordings of one cell are merged, and the output names the source of each sample."""
    for name in ("a", "b"):
        assert main(["simulate", str(tmp_path / name), "--samples", "6", "--target", "pose", "--seed", "3"]) == 0
    capsys.readouterr()
    assert main(["merge", str(tmp_path / "a"), str(tmp_path / "b"), "-o", str(tmp_path / "c")]) == 0
    said, following = capsys.readouterr()
    assert f"{tmp_path / 'b'}: 6 samples of eye, hand, from number 6 on" in said
    assert following.rstrip().endswith(f"basecal calibrate {tmp_path / 'c'}")
    assert [sample.sample for sample in read_recording(tmp_path / "c").samples] == list(range(12))


def test_one_cell_is_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two cells are required."""
    assert main(["merge", str(tmp_path), "-o", str(tmp_path / "c")]) == 2
    assert "give two cells or more" in capsys.readouterr().err


def test_omitted_samples_are_reported(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """For each part, the omitted samples are listed with their robots in order; a part may have none."""
    finding = Finding("duplicate-sample", "warning", (), "Sample 3 is there twice.")
    first = Recording((Sample(0, robots={"b": RobotState()}), Sample(1, robots={"a": RobotState(), "b": RobotState()})))
    parts = [
        SimpleNamespace(folder=name, recording=each) for name, each in (("x", first), ("y", Recording((), (finding,))))
    ]
    merged = SimpleNamespace(parts=parts, first_numbers=(0, 2), recording=first)
    monkeypatch.setattr("basecal.exchange.merging.merge_cells", lambda cells, output: merged)
    assert merge(Path("x"), Path("y"), output=Path("a b")) == 0
    out, err = capsys.readouterr()
    assert out.splitlines() == [
        "x: 2 samples of b, a, from number 0 on",
        "y: 0 samples of no robot, from number 2 on",
        "left out: Sample 3 is there twice.",
        "2 samples written to a b",
    ]
    assert err == "next: basecal calibrate 'a b'\n"
