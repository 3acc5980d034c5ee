"""Tests of `read_images`: images of a recording as views of a scene."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.accuracy.scene.images import Images, _extent, _moving_targets, read_images
from basecal.cell import PixelObservation, PoseObservation, RobotState, Sample
from basecal.cell.files import read_cell, read_recording
from basecal.errors import InputError
from basecal.estimation.settings import Settings
from basecal.geometry import SE3
from planar_arm import planar

CELL = """schema: basecal/cell/1
reference: left
target: scene
robots: {left: {}, right: {}}
cameras:
  left_eye: {on: left, model: pinhole, size_px: [160, 120],
    intrinsics: {status: fixed, fx: 130.0, fy: 130.0, cx: 79.5, cy: 59.5, distortion: [0, 0, 0, 0, 0]}}
  right_eye: {on: right}
targets:
  board: {on: right, kind: points, points_m: [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]}
"""
LEFT, RIGHT = (
    {name: {"base_from_flange": {"t_m": [0.4, 0.0, 0.5], "q_xyzw": [0, 0, 0, 1]}}} for name in ("left", "right")
)


def write(folder: Path, samples: list[dict]) -> None:
    """A cell with image files for each sample."""
    (folder / "recording").mkdir(parents=True, exist_ok=True)
    (folder / "cell.yaml").write_text(CELL)
    lines = [json.dumps({"sample": k, **sample}) for k, sample in enumerate(samples)]
    (folder / "recording/samples.jsonl").write_text("\n".join(lines) + "\n")
    for sample in samples:
        for path in sample.get("images", {}).values():
            rng = np.random.default_rng(len(path))
            levels = rng.integers(0, 255, (30, 40)).repeat(4, 0).repeat(4, 1).astype(np.uint8)
            cv2.imwrite(str(folder / "recording" / path), levels)


def read(folder: Path) -> Images:
    """The images of a folder."""
    cell = read_cell(folder)
    recording = read_recording(folder, cell)
    return read_images(cell, recording)


def test_each_image_with_pose_is_view(tmp_path: Path) -> None:
    """Images without a pose of their camera's arm, and samples without images, are skipped."""
    write(
        tmp_path,
        [
            {"robots": LEFT, "images": {"left_eye": "a.png"}},
            {"robots": LEFT, "images": {"right_eye": "bb.png"}},
            {"robots": LEFT | RIGHT, "images": {"left_eye": "ccc.png", "right_eye": "dddd.png"}},
            {"robots": RIGHT},
        ],
    )
    found = read(tmp_path)
    assert found.views.robots == ("left", "right")
    np.testing.assert_array_equal(found.views.sample, [0, 2, 2])
    np.testing.assert_array_equal(found.views.camera, [0, 0, 1])
    np.testing.assert_array_equal(found.views.stop_robot[found.views.stop], [0, 0, 1])
    assert found.views.camera.tolist() == [0, 0, 1]
    assert min(len(each) for each in found.features) > 20


def test_unstated_lens_is_guessed(tmp_path: Path) -> None:
    """An unstated lens is guessed as a usual one for the image size; a stated lens is kept."""
    write(tmp_path, [{"robots": LEFT | RIGHT, "images": {"left_eye": "a.png", "right_eye": "bb.png"}}])
    found = read(tmp_path)
    assert found.is_guessed == (False, True)
    assert found.lenses[0].parameters[0] == 130.0
    assert found.lenses[1].size_px == (160, 120)
    np.testing.assert_allclose(found.lenses[1].parameters[:4], [144, 144, 79.5, 59.5])


def test_features_on_carried_targets_are_excluded(tmp_path: Path) -> None:
    """Features are excluded where a board carried by an arm was seen."""
    write(tmp_path, [{"robots": LEFT, "images": {"left_eye": "a.png"}}])
    every = read(tmp_path).features[0].pixels
    corners = [[20, 20], [140, 20], [80, 100]]
    seen = {"camera": "left_eye", "target": "board", "ids": [0, 1, 2], "pixels": corners}
    write(tmp_path, [{"robots": LEFT, "images": {"left_eye": "a.png"}, "observations": [seen]}])
    found = read(tmp_path).features[0].pixels
    inside = (np.abs(found - [80, 40]) < 12).all(1)
    assert 0 < len(found) < len(every)
    assert (np.abs(every - [80, 40]) < 12).all(1).any()
    assert not inside.any()


def test_joints_without_urdf_are_input_error(tmp_path: Path) -> None:
    """A robot recorded by joints without a URDF is an InputError."""
    write(tmp_path, [{"robots": LEFT, "images": {"left_eye": "a.png"}}])
    cell = read_cell(tmp_path)
    recording = read_recording(tmp_path, cell)
    by_joints = replace(recording.samples[0], robots={"left": RobotState(joints_rad=np.zeros(6))})
    with pytest.raises(InputError, match="'left' is recorded by joints and has no urdf"):
        read_images(cell, replace(recording, samples=(by_joints,)))


def test_robots_with_recorded_joints_are_listed(tmp_path: Path) -> None:
    """Robots with recorded joints are listed; a URDF alone does not count, and another robot may record poses."""
    chain = planar(1.0, 1.0)
    write(tmp_path, [{"robots": LEFT | RIGHT, "images": {"left_eye": "a.png", "right_eye": "bb.png"}}])
    cell = read_cell(tmp_path)
    cell = replace(cell, robots={name: replace(robot, chain=chain) for name, robot in cell.robots.items()})
    recording = read_recording(tmp_path, cell)
    (sample,) = recording.samples
    joints = {"left": RobotState(joints_rad=np.zeros(len(chain.joint_names)))}
    recording = replace(recording, samples=(replace(sample, robots={**sample.robots, **joints}),))
    assert read_images(cell, recording).joint_robots == ("left",)


@pytest.mark.parametrize(
    ("stated", "model", "terms"),
    [
        ("", "pinhole", 5),
        ("size_px: [160, 120], intrinsics: {status: free, distortion_terms: 8}", "pinhole", 8),
        ("model: fisheye, size_px: [160, 120], intrinsics: {status: free}", "fisheye", 4),
    ],
)
def test_guessed_lens_has_requested_model(tmp_path: Path, stated: str, model: str, terms: int) -> None:
    """A guessed lens has the model and number of distortion terms of the cell, all zero."""
    write(tmp_path, [{"robots": LEFT | RIGHT, "images": {"right_eye": "bb.png"}}])
    (tmp_path / "cell.yaml").write_text(CELL.replace("{on: right}", f"{{on: right, {stated}}}"))
    (lens,) = read(tmp_path).lenses
    assert lens.model == model
    assert lens.distortion.tolist() == [0.0] * terms


def test_recording_without_folder_is_input_error(tmp_path: Path) -> None:
    """A recording of images without a folder, not read from a cell, is an InputError."""
    write(tmp_path, [{"robots": LEFT, "images": {"left_eye": "a.png"}}])
    cell = read_cell(tmp_path)
    with pytest.raises(InputError, match="read the recording from its cell's folder"):
        read_images(cell, replace(read_recording(tmp_path, cell), folder=None))


def test_unreadable_image_is_named(tmp_path: Path) -> None:
    """An unreadable image is named in a finding, and the others are used."""
    write(
        tmp_path, [{"robots": LEFT, "images": {"left_eye": "a.png"}}, {"robots": LEFT, "images": {"left_eye": "b.png"}}]
    )
    (tmp_path / "recording" / "b.png").write_bytes(b"no image")
    found = read(tmp_path)
    assert found.views.camera.tolist() == [0]
    assert [(each.code, each.about) for each in found.lost] == [("dropped-sample", ("1", "left_eye"))]


def test_progress_of_images_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Each image that is read is logged, since its features take up to a second."""
    write(tmp_path, [{"robots": LEFT | RIGHT, "images": {"left_eye": "a.png", "right_eye": "bb.png"}}])
    cell = read_cell(tmp_path)
    with caplog.at_level("INFO", logger="basecal"):
        read_images(cell, read_recording(tmp_path, cell), Settings())
    assert [each.message for each in caplog.records] == ["1 of 2", "2 of 2"]


def test_extent_contains_all_tracked_pixels() -> None:
    """The extent is one pixel beyond the last tracked pixel, and at least two."""
    assert _extent(np.array([[10.2, 3.0], [4.0, 7.5]])) == (12, 9)
    assert _extent(np.zeros((0, 2))) == (2, 2)


def test_carried_targets_move(tmp_path: Path) -> None:
    """Targets on robots seen by this camera as pixels count as moving; targets on the world belong to the scene."""
    write(tmp_path, [])
    cell = read_cell(tmp_path)
    still = replace(cell.targets["board"], name="still", on="world")
    cell = replace(cell, targets={**cell.targets, "still": still})
    ids, pixels = np.arange(3), np.arange(6.0).reshape(3, 2)
    seen = (
        PixelObservation("left_eye", "board", ids, pixels),
        PixelObservation("left_eye", "still", ids, pixels),
        PixelObservation("right_eye", "board", ids, pixels + 1),
        PoseObservation("left_eye", "board", SE3.identity()),
    )
    (found,) = _moving_targets(cell, Sample(0, observations=seen), "left_eye")
    np.testing.assert_array_equal(found, pixels)
