"""Tests of `verify` with new images of a scene that a calibration kept."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.scene import find_scene
from basecal.accuracy.scene import fingerprint as room
from basecal.accuracy.scene.calibrate_scene import calibrate_scene
from basecal.cell import Recording, Sample
from basecal.cell.files import read_calibration, read_cell, read_recording, write_calibration
from basecal.cell.fingerprint import Fingerprint
from basecal.cli import main
from basecal.cli.calibrate import CalibratedFolder
from basecal.cli.verify import _renumber_sample
from basecal.estimation.settings import Settings
from basecal.geometry import SE3
from basecal.vision.tracks.locating import Located
from scene_images import solved_camera
from scene_points import ARM_M, ARM_RAD, BASE, LENS, MOUNT, PIXEL, Scene, looks, made_scene
from scene_tracks import write_tracks

NOISE = np.repeat([ARM_M, ARM_RAD], 3)


def calibrated_cell(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Scene:
    """A cell calibrated by tracks, without the search for mounts."""
    scene = made_scene(1, arms=2, count=12, points=220)
    write_tracks(folder, scene)
    monkeypatch.setattr(find_scene, "solve_camera", lambda images, camera, _: solved_camera(scene, images, camera))
    cell = read_cell(folder)
    write_calibration(calibrate_scene(cell, read_recording(folder, cell), Settings()), folder)
    return scene


def new_samples(folder: Path, scene: Scene, count: int = 4, base: SE3 = BASE, mount: SE3 = MOUNT) -> Path:
    """New tracks of the same points for each arm; the right base and mount may have moved."""
    rng, lines = np.random.default_rng(99), []
    for arm, (name, at, hand) in enumerate((("left", SE3.identity(), MOUNT), ("right", base, mount))):
        for world_from_camera in looks(rng, count, 2.0 * arm - 1):
            points = world_from_camera.inverse() @ scene.truth.points
            shown = np.flatnonzero(LENS.sees(points) & (rng.random(len(points)) < 0.7))
            pixels = LENS.project(points[shown]) + PIXEL * rng.standard_normal((len(shown), 2))
            error = SE3.exp(rng.standard_normal(6) * NOISE)
            pose = at.inverse() @ world_from_camera @ hand.inverse() @ error
            state = {"base_from_flange": {"t_m": pose.translation.tolist(), "q_xyzw": pose.quaternion.tolist()}}
            seen = {"camera": f"{name}_eye", "tracks": shown.tolist(), "pixels": pixels.tolist()}
            lines.append({"sample": len(lines), "robots": {name: state}, "observations": [seen]})
    path = folder / "new.jsonl"
    path.write_text("\n".join(map(json.dumps, lines)) + "\n")
    return path


def run_verify(folder: Path, samples: Path, capsys: pytest.CaptureFixture[str]) -> dict:
    """The output of `verify`."""
    capsys.readouterr()
    assert main(["verify", str(folder), str(samples), "--json"]) in (0, 1)
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_moved_base_and_mount_are_detected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A base and a mount moved by 5 mm are named with their shift; without a move there is no report."""
    scene = calibrated_cell(tmp_path, monkeypatch)
    aside = SE3.exp(np.array([0.005, 0, 0, 0, 0, 0]))
    still, base, mount = (
        run_verify(tmp_path, new_samples(tmp_path, scene, **moved), capsys)
        for moved in ({}, {"base": BASE @ aside}, {"mount": MOUNT @ aside})
    )
    assert still["moved"] is False
    assert len(still["samples"]) == 8
    assert still["detectable_mm"] < 5
    for found, name in ((base, "left_base_from_right_base"), (mount, "right_flange_from_right_eye")):
        assert (found["moved"], found["transform"]) == (True, name)
        assert found["shift_mm"] == pytest.approx(5.0, abs=1.5)


@pytest.mark.journey
def test_recalibration_adds_new_tracks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """If nothing moved, `--recalibrate` adds new tracks to the recording; images are copied under new names."""
    path = new_samples(tmp_path, calibrated_cell(tmp_path, monkeypatch))
    (run,) = (tmp_path / "runs").iterdir()
    made = CalibratedFolder(read_calibration(run), run)
    monkeypatch.setattr("basecal.cli.calibrate.calibrate_folder", lambda *_, **__: made)
    assert main(["verify", str(tmp_path), str(path), "--recalibrate", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["recalibration"]["added"] == list(range(24, 32))
    samples = read_recording(tmp_path, read_cell(tmp_path)).samples
    assert [sample.sample for sample in samples if sample.tracks] == list(range(32))
    files: dict[str, Path] = {}
    shown = replace(samples[0], images={"left_eye": "recording/images/a.png"})
    moved = _renumber_sample(shown, 40, "today", files)
    assert moved.images == {"left_eye": "recording/images/000040_a.png"}
    assert files == {"recording/images/000040_a.png": Path("today/recording/images/a.png")}


def test_scene_points_are_observed_in_image(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scene points in an image are ordered by number, with a sigma of 1.5 times their scatter."""
    points = np.array([[0.1, 0.2, 2.0], [-0.1, 0.1, 1.5], [0.0, -0.1, 1.0], [0.3, 0.0, 2.0]])
    off = np.array([[0.5, -0.5], [0.4, 0.6], [-0.5, 0.5]])
    where, shown = SE3.from_rotvec([0.0, 0.1, 0.0], [0.0, 0.0, 0.1]), np.array([3, 0, 1])
    pixels = np.concatenate([np.zeros((1, 2)), LENS.project(where @ points[shown]) + off])
    views = SimpleNamespace(camera=np.array([1]), cameras=(SimpleNamespace(name="a"), SimpleNamespace(name="b")))
    images = SimpleNamespace(features=[SimpleNamespace(pixels=pixels)], views=views)
    target = SimpleNamespace(name="scene", target=SimpleNamespace(points=points))
    monkeypatch.setattr(room, "locate_camera", lambda *given: Located(where, shown, np.array([1, 2, 3])))
    found = room._observe_scene(images, 0, LENS, None, target)
    assert (found.camera, found.target, found.ids.tolist()) == ("b", "scene", [0, 1, 3])
    np.testing.assert_array_equal(found.pixels, pixels[[2, 3, 1]])
    np.testing.assert_allclose(found.sigma_px, 1.5 * 1.4826 * 0.5)
    monkeypatch.setattr(room, "locate_camera", lambda *given: None)
    assert room._observe_scene(images, 0, LENS, None, target) is None


def test_scene_is_exact_target_on_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scene is an exact target on the world, under an unused name.

    Each image uses the lens of the calibration, or its own.
    """
    write_tracks(tmp_path, made_scene(1, arms=2, count=2, points=12))
    cell = read_cell(tmp_path)
    points = np.arange(9.0).reshape(3, 3)
    views = SimpleNamespace(
        sample=np.array([0, 1, 1]), camera=np.array([0, 1, 0]), cameras=[SimpleNamespace(name=n) for n in "ab"]
    )
    images = SimpleNamespace(views=views, lenses=["own a", "own b"])
    monkeypatch.setattr(room, "read_images", lambda cell, recording: images)
    monkeypatch.setattr(room, "unit_descriptors", lambda levels: levels)
    monkeypatch.setattr(room, "_observe_scene", lambda images, row, lens, *more: (row, lens) if row != 1 else None)
    calibration = SimpleNamespace(cameras={"a": ("found a", None)})
    old = Recording((Sample(0), Sample(1), Sample(2)))
    described, seen = room.with_scene_as_target(cell, calibration, old, Fingerprint(points, np.zeros((3, 128))))
    assert [each.observations for each in seen.samples] == [((0, "found a"),), ((2, "found a"),), ()]
    target = described.targets["scene"]
    assert (target.on, target.mount.status, target.size_sigma) == ("world", "fixed", 0.0)
    np.testing.assert_array_equal(target.mount.mean.matrix, np.eye(4))
    np.testing.assert_array_equal(target.target.points, points)
    again, _ = room.with_scene_as_target(described, calibration, old, Fingerprint(points, np.zeros((3, 128))))
    assert set(again.targets) - set(described.targets) == {"static_scene"}
