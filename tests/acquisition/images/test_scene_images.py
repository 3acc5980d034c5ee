"""Tests of capturing images of a scene: two hand-guided arms, typed poses, and images from folders."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from basecal.cell.files import latest_run, read_calibration, read_cell, read_recording, read_truth
from basecal.cli import main

ROOT = Path(__file__).parents[3]
ARMS = "left", "right"
BASE = "left_base_from_right_base"


def rendered(folder: Path, views: int, size: str) -> Path:
    """Cell of the example with its images and poses, as shown by the cameras and pendants."""
    make = ROOT / "examples" / "scene" / "make.py"
    subprocess.run([sys.executable, make, folder / "made", "--views", str(views), "--size", size], check=True)
    return folder / "made"


def cell_to_capture(made: Path, folder: Path) -> list[list[str]]:
    """Write a cell without a recording, with typed poses and saved images; return the lines for each arm."""
    cell = yaml.safe_load((made / "cell.yaml").read_text())
    samples, lines = read_recording(made).samples, []
    for arm in ARMS:
        cell["robots"][arm]["driver"] = {"kind": "typed", "notation": "ur"}
        saved = {"kind": "folder", "path": f"{arm}_saved", "existing": True}
        cell["cameras"][f"{arm}_eye"] |= {"on": arm, "driver": saved}
        cell["cameras"][f"{arm}_eye"].pop(True)  # YAML 1.1 reads the word on as a truth
        own = [sample for sample in samples if arm in sample.robots]
        poses = [sample.robots[arm].base_from_flange for sample in own]
        lines.append([" ".join(map(repr, map(float, [*pose.translation, *pose.rotvec]))) for pose in poses])
        for number, sample in enumerate(own):
            copy(made / sample.images[f"{arm}_eye"], folder / f"{arm}_saved", number)
    (folder / "cell.yaml").write_text(yaml.safe_dump(cell))
    return lines


def copy(image: Path, folder: Path, number: int) -> None:
    """Save an image under that number: cameras return the oldest first."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{number}.png").write_bytes(image.read_bytes())
    os.utime(folder / f"{number}.png", (1e9 + number, 1e9 + number))


def capture(folder: Path, lines: list[str], monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    """Exit code of a capture by hand with these typed lines."""
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n".join(lines) + "\n"))
    return main(["capture", str(folder), "--freedrive", *words])


@pytest.mark.journey
def test_each_image_is_checked_at_once(tmp_path, monkeypatch, capsys) -> None:
    """An image of a bare wall is refused with advice; an arm that stayed yields no second image."""
    made = rendered(tmp_path, 3, "320x240")
    folder = tmp_path / "mine"
    folder.mkdir()
    left, right = cell_to_capture(made, folder)
    bare = folder / "right_saved" / "1.png"
    cv2.imwrite(str(bare), np.full((240, 320), 128, dtype=np.uint8))
    os.utime(bare, (1e9 + 1, 1e9 + 1))
    typed = [left[0], right[0], left[1], right[1], left[0], right[2]]
    assert capture(folder, typed, monkeypatch, "--samples", "2") == 0
    said = capsys.readouterr().out
    assert "sample 1: not taken: right_eye sees 0 features of the scene, 100 are needed: put printed paper" in said
    assert "2/2 sample 1: taken" in said
    samples = read_recording(folder).samples
    assert [sorted(sample.images) for sample in samples] == [["left_eye", "right_eye"], ["right_eye"]]


@pytest.mark.journey
def test_samples_before_a_failure_are_kept(tmp_path, monkeypatch, capsys) -> None:
    """The end of the poses, or missing images, end the capture in one line; a restart continues it."""
    made = rendered(tmp_path, 3, "320x240")
    folder = tmp_path / "mine"
    folder.mkdir()
    left, right = cell_to_capture(made, folder)
    assert capture(folder, [left[0], right[0], left[1]], monkeypatch, "--samples", "3") == 3
    assert "the input has ended" in capsys.readouterr().err
    for arm in ARMS:
        (folder / f"{arm}_saved" / "0.png").unlink()
    (folder / "right_saved" / "2.png").unlink()
    text = (folder / "cell.yaml").read_text()
    (folder / "cell.yaml").write_text(text.replace("existing: true", "existing: true\n      wait_s: 0.2"))
    assert capture(folder, [left[1], right[1], left[2], right[2]], monkeypatch, "--samples", "2") == 3
    assert "no new image" in capsys.readouterr().err
    assert [sorted(sample.images) for sample in read_recording(folder).samples] == [["left_eye", "right_eye"]] * 2


@pytest.mark.journey
def test_missing_drivers_of_cameras_and_arms(tmp_path, monkeypatch, capsys) -> None:
    """A camera without a driver is left out; an arm without one, whose camera has one, is reported."""
    made = rendered(tmp_path, 3, "320x240")
    folder = tmp_path / "mine"
    folder.mkdir()
    left, _ = cell_to_capture(made, folder)
    cell = yaml.safe_load((folder / "cell.yaml").read_text())
    del cell["robots"]["right"]["driver"]
    for camera in cell["cameras"].values():
        camera["on"] = camera.pop(True) if True in camera else camera["on"]
    (folder / "cell.yaml").write_text(yaml.safe_dump(cell))
    assert capture(folder, left[:1], monkeypatch, "--samples", "1") == 3
    assert "robot 'right', which carries right_eye, has no `driver`" in capsys.readouterr().err
    del cell["cameras"]["right_eye"]["driver"]
    (folder / "cell.yaml").write_text(yaml.safe_dump(cell))
    assert capture(folder, left[:1], monkeypatch, "--samples", "1") == 0
    assert [sorted(sample.images) for sample in read_recording(folder).samples] == [["left_eye"]]


@pytest.mark.journey
def test_scene_moves_no_arm(tmp_path, capsys) -> None:
    """With unknown bases no motion can be planned; the line has advice."""
    made = rendered(tmp_path, 3, "160x120")
    cell_to_capture(made, tmp_path)
    assert main(["capture", str(tmp_path), "--go"]) == 3
    assert "--freedrive" in capsys.readouterr().err


@pytest.mark.slow
def test_scene_is_captured_and_calibrated(tmp_path, monkeypatch) -> None:
    """Two commands lead from typed poses to a base within 3 mm and 0.15 deg of the example's own recording."""
    made = rendered(tmp_path, 10, "480x360")
    folder = tmp_path / "mine"
    folder.mkdir()
    left, right = cell_to_capture(made, folder)
    assert (
        capture(
            folder, [line for pair in zip(left, right, strict=True) for line in pair], monkeypatch, "--samples", "10"
        )
        == 0
    )
    assert main(["calibrate", str(folder)]) == 1
    off = read_truth(made)[BASE].inverse() @ read_calibration(latest_run(folder))[BASE].mean
    assert read_cell(folder).sees_scene
    assert np.linalg.norm(off.translation) < 3e-3
    assert np.degrees(np.linalg.norm(off.rotvec)) < 0.15
