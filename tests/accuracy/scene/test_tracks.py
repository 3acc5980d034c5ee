"""Tests of tracks of a static scene in `samples.jsonl`, through the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording, write_recording
from basecal.cli import main
from basecal.geometry import SE3
from scene_points import BASE, MOUNT, made_scene
from scene_tracks import write_tracks


def print_refusal(folder: Path, observations: list[dict], capsys: pytest.CaptureFixture[str]) -> str:
    """Error output of the command for an unreadable line."""
    (folder / "recording" / "samples.jsonl").write_text(json.dumps({"sample": 0, "observations": observations}) + "\n")
    assert main(["calibrate", str(folder)]) == 3
    return capsys.readouterr().err


@pytest.mark.slow
def test_tracks_give_mounts_and_base(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Mounts and base are within their 99.99 % ellipsoids (27.9 of 6) and 3 mm; each view has its residual."""
    write_tracks(tmp_path, made_scene(3, arms=2, count=12, points=220))
    assert main(["calibrate", str(tmp_path), "--json", "--tolerance", "5mm"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert {each["code"] for each in answer["findings"]} == {"not-validated", "scene-joined", "scene-scale"}
    names = "left_base_from_right_base", "left_flange_from_left_eye", "right_flange_from_right_eye"
    for name, true in zip(names, (BASE, MOUNT, MOUNT), strict=True):
        found = answer["transforms"][name]
        off = (true.inverse() @ SE3.from_quaternion(found["q_xyzw"], found["t_m"])).log()
        assert off @ np.linalg.solve(np.array(found["covariance"]), off) < 27.9
        assert np.linalg.norm(off[:3]) < 3e-3
    assert len(answer["residuals"]["per_sample"]) == 24
    assert 0 < answer["tolerance"]["expected_95_m"] < 5e-3
    page = next((tmp_path / "runs").glob("*/report.html"))
    fresh = page.read_text()
    assert main(["report", str(tmp_path)]) == 1
    assert page.read_text() == fresh


def test_tracks_survive_write_and_read(tmp_path: Path) -> None:
    """A recording with tracks is read back as it was written."""
    write_tracks(tmp_path, made_scene(1, count=3, points=40))
    cell = read_cell(tmp_path)
    before = read_recording(tmp_path, cell)
    (tmp_path / "recording" / "samples.jsonl").unlink()
    write_recording(before, tmp_path)
    after = read_recording(tmp_path, cell)
    for one, other in zip(before.samples, after.samples, strict=True):
        assert one.tracks[0].tracks.tolist() == other.tracks[0].tracks.tolist()
        np.testing.assert_array_equal(one.tracks[0].pixels, other.tracks[0].pixels)


@pytest.mark.parametrize(
    ("observations", "reason"),
    [
        ([{"camera": "left_eye", "tracks": [1, 2], "pixels": [[0, 0]]}], "2 tracks for 1 pixel"),
        ([{"camera": "left_eye", "tracks": [1, 1], "pixels": [[0, 0], [1, 1]]}], "given twice in one image"),
        ([{"camera": "left_eye", "tracks": [1], "pixels": [[0, 0]], "target": "board"}], "target"),
        ([{"camera": "left_eye", "tracks": [1.5], "pixels": [[0, 0]]}], "whole numbers"),
        ([{"camera": "left_eye", "tracks": [1], "pixels": [[0, 0]]}] * 2, "tracks twice in one sample"),
        ([{"camera": "nobody", "tracks": [1], "pixels": [[0, 0]]}], "nobody"),
    ],
)
def test_invalid_track_line_is_one_clear_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], observations: list[dict], reason: str
) -> None:
    """An invalid line prints its place and the reason."""
    write_tracks(tmp_path, made_scene(1, count=3, points=40))
    message = print_refusal(tmp_path, observations, capsys)
    assert reason in message
    assert "samples.jsonl:1: observations[" in message


@pytest.mark.journey
def test_refused_scene_does_not_repeat_failed_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Seven images are reported as too few, and the failed command is proposed only after the advice."""
    write_tracks(tmp_path, made_scene(1, arms=2, count=7, points=100))
    assert main(["calibrate", str(tmp_path), "--scene"]) == 4
    printed = capsys.readouterr()
    assert "[too-few-samples]" in printed.out
    assert f"next: follow the advice above, then basecal calibrate {tmp_path} --scene" in printed.err
    assert "or: basecal" not in printed.out
