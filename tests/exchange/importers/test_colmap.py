"""Tests of `basecal import colmap`."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import PoseObservation
from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.errors import DatasetError
from basecal.exchange.importers.colmap import read_colmap_images
from basecal.geometry import SE3
from colmap_files import IMAGES, Image, binary_images, text_images, write_reconstruction
from lens_texts import COLMAP, reads_lens
from stream_cells import MOUNT, streamed


def test_lens_is_imported_with_half_pixel_shift(tmp_path: Path) -> None:
    """A camera of a new cell has the lens, shifted by half a pixel from COLMAP's convention."""
    assert reads_lens(tmp_path, "colmap", "cameras.bin", COLMAP)


def test_camera_is_chosen_by_id(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The error requests a choice if there are several cameras; a folder is read by the file in it."""
    first = "1 OPENCV 640 480 600 601 320.5 240.5 0.1 -0.2 0 0\n"
    (tmp_path / "cameras.txt").write_text(first + first.replace("1 OPENCV", "7 OPENCV").replace("600", "650"))
    words = ["import", "colmap", str(tmp_path / "c"), str(tmp_path), "--camera", "wrist", "--on", "left"]
    assert main(words) == 3
    assert "has cameras 1, 7: choose one with --camera-id" in capsys.readouterr().err
    assert main([*words, "--camera-id", "2"]) == 3
    assert "has cameras 1, 7: choose one with --camera-id" in capsys.readouterr().err
    assert not (tmp_path / "c").exists()
    assert main([*words, "--camera-id", "7"]) == 0
    assert "650" in (tmp_path / "c" / "cell.yaml").read_text()


def test_images_of_one_folder_are_chosen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two folders of one camera hold equal names: a choice is requested, and the named folder is used."""
    names = [f"{folder}/{k}.png" for folder in ("left", "right") for k in range(3)]
    poses = [SE3.exp([0.1 * k, 0, 1, 0.2 * k, 0.1, 0]) for k in range(6)]
    write_reconstruction(tmp_path / "sparse", [Image(n, 1, p) for n, p in zip(names, poses, strict=True)])
    words = ["import", "colmap", str(tmp_path / "c"), str(tmp_path / "sparse"), "--camera", "eye", "--on", "arm"]
    words += ["--target", "room"]
    assert main(words) == 3
    assert 'images 0, 1, 2 are in several folders: choose one by --images "left/*"' in capsys.readouterr().err
    assert main([*words, "--images", "middle/*"]) == 3
    assert "no image is named middle/*; its images: left/0.png" in capsys.readouterr().err
    assert main([*words, "--images", "right/*"]) == 0
    samples = read_recording(tmp_path / "c").samples
    seen = [sample.observations[0].camera_from_target.translation for sample in samples]
    np.testing.assert_allclose(seen, [pose.translation for pose in poses[3:]], atol=1e-6)


@pytest.mark.journey
def test_clock_unit_and_mount_from_moving_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Image names are times of another clock: its offset, the unit and the mount are estimated together."""
    samples = streamed(-0.07, stated=False).recording.samples
    rows, images = ["stamp_s,x,y,z,qx,qy,qz,qw"], []
    for sample in samples:
        assert sample.stamp_s is not None
        for state in sample.robots.values():
            pose = state.base_from_flange
            assert pose is not None
            rows.append(",".join(map(repr, [sample.stamp_s, *pose.translation.tolist(), *pose.quaternion.tolist()])))
        for seen in sample.observations:
            assert isinstance(seen, PoseObservation)
            view = seen.camera_from_target
            images.append(Image(f"film/{sample.stamp_s:.6f}.png", 1, SE3(view.rotation, view.translation / 0.21)))
    (tmp_path / "arm.csv").write_text("\n".join(rows) + "\n")
    cell, sparse = str(tmp_path / "c"), str(write_reconstruction(tmp_path / "sparse", images))
    assert main(["import", "poses", cell, "--robot", "arm", str(tmp_path / "arm.csv"), "--streams"]) == 0
    words = ["import", "colmap", cell, sparse, "--camera", "wrist", "--on", "arm", "--streams"]
    assert main(words) == 2
    assert "--streams needs poses: add --target NAME" in capsys.readouterr().err
    assert main([*words, "--target", "room"]) == 0
    assert "conventions hold" in capsys.readouterr().out
    found = calibrate(read_cell(cell), read_recording(cell))
    assert found.clocks["wrist"].offset_s == pytest.approx(-0.07, abs=4 * found.clocks["wrist"].sigma_s)
    assert found.clocks["wrist"].sigma_s < 2e-3
    mount = found["arm_flange_from_wrist"]
    off = (mount.mean.inverse() @ MOUNT).log()
    assert off @ np.linalg.solve(mount.covariance, off) < 22.46
    (unit,) = (each for each in found.findings if each.code == "unit-length")
    assert float(unit.what.split(" is ")[1].split()[0]) == pytest.approx(210, rel=0.01)


@pytest.mark.parametrize("name", ["images.bin", "images.txt"])
def test_images_are_sorted_by_number_in_name(tmp_path: Path, name: str) -> None:
    """Each image has its camera and its pose."""
    content = {"images.bin": binary_images(IMAGES), "images.txt": text_images(IMAGES).encode()}[name]
    (tmp_path / name).write_bytes(content)
    found = read_colmap_images(tmp_path)
    assert [(image.name, image.camera) for image in found] == [("base.png", 2), ("wrist 9.png", 1), ("wrist 10.png", 1)]
    for image in found:
        truth = next(each for each in IMAGES if each.name == image.name)
        np.testing.assert_allclose(image.camera_from_world.matrix, truth.camera_from_world.matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1 1 0 0 0 0 0 0", "images.txt:1: 8 words, expected IMAGE_ID QW"),
        ("1 1 0 0 0 0 0 x 1 a.png", "images.txt:1: '1 1 0 0 0 0 0 x 1 a.png' has a word that is not a number"),
        ("1 0.5 0 0 0 0 0 0 1 a.png", "QW QX QY QZ has length 0.5, expected 1"),
        ("1 1 0 0 0 0 0 nan 1 a.png", "holds a number that is not finite"),
        ("# nothing", "holds no image"),
    ],
)
def test_invalid_image_line_is_reported(tmp_path: Path, line: str, message: str) -> None:
    """The error names the line and what was expected."""
    (tmp_path / "images.txt").write_text(line + "\n\n")
    with pytest.raises(DatasetError, match=re.escape(message)):
        read_colmap_images(tmp_path)


@pytest.mark.journey
def test_truncated_binary_is_refused(tmp_path: Path) -> None:
    """A file cut at any byte is reported as cut off."""
    whole = binary_images(IMAGES)
    for size in range(len(whole)):
        (tmp_path / "images.bin").write_bytes(whole[:size])
        with pytest.raises(DatasetError, match="cut off"):
            read_colmap_images(tmp_path)


def test_folder_without_images_file_is_refused(tmp_path: Path) -> None:
    """The error names both possible files."""
    with pytest.raises(DatasetError, match=r"neither images\.bin nor images\.txt"):
        read_colmap_images(tmp_path)
