"""Tests of `basecal import images`: folders of images are paired with a recording."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.shared.real_recordings import data_folder

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main


def photos(folder: Path, names: list[str], size: tuple[int, int] = (64, 48)) -> str:
    folder.mkdir(exist_ok=True)
    for i, name in enumerate(names):
        cv2.imwrite(str(folder / name), np.full((size[1], size[0]), 10 * i, np.uint8))
    return str(folder)


def table(path: Path, count: int, column: str = "", values: list[str] | None = None) -> str:
    lines = ["x,y,z,rx,ry,rz" + (f",{column}" if column else "")]
    lines += [f"0.4,0.{i},0.3,0,0,0.{i}" + (f",{values[i]}" if values else "") for i in range(count)]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def poses_by_image(cell: Path) -> dict[str, float]:
    """Return the y of the robot's pose [dm] by the name of the image of its sample."""
    found = {}
    for sample in read_recording(cell).samples:
        if sample.images and sample.robots:
            pose = sample.robots["arm"].base_from_flange
            assert pose is not None
            found[Path(sample.images["cam"]).name] = round(10 * float(pose.translation[1]))
    return found


def test_images_pair_with_rows_in_order(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Images in natural order pair with the rows of a table, whichever is imported first; the cell is made of both."""
    folder, rows = photos(tmp_path / "p", ["i10.png", "i2.png", "i1.png"]), table(tmp_path / "t.csv", 3)
    poses = ["--robot", "arm", rows, "--format", "ur"]
    for name, words in {
        "a": (["poses", *poses], ["images", folder, "--camera", "cam", "--on", "arm"]),
        "b": (["images", folder, "--camera", "cam", "--on", "arm"], ["poses", *poses]),
    }.items():
        for kind, *rest in words:
            assert main(["import", kind, str(tmp_path / name), *rest]) == 0
        assert poses_by_image(tmp_path / name) == {"i1.png": 0, "i2.png": 1, "i10.png": 2}
        camera = read_cell(tmp_path / name).cameras["cam"]
        assert (camera.on, camera.size_px) == ("arm", (64, 48))
    assert "3 images of 'cam', 64 x 48 px" in capsys.readouterr().out


@pytest.mark.parametrize("first", ["poses", "images"])
def test_images_pair_with_rows_by_name(tmp_path: Path, first: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A column `image` pairs by name in either order; unpaired images or rows are reported."""
    folder = photos(tmp_path / "p", ["a.png", "b.png", "c.png", "d.png"])
    rows = table(tmp_path / "t.csv", 3, "image", ["c.png", "a.png", "x.png"])
    poses = ["poses", str(tmp_path / "c"), "--robot", "arm", rows, "--format", "ur"]
    images = ["images", str(tmp_path / "c"), folder, "--camera", "cam", "--on", "arm"]
    for words in (poses, images) if first == "poses" else (images, poses):
        assert main(["import", *words]) == 0
    assert poses_by_image(tmp_path / "c") == {"c.png": 0, "a.png": 1}
    message = capsys.readouterr().out
    left_out = "b.png, d.png" if first == "poses" else "x.png"
    assert f"not paired, and left out: {left_out}" in message


def test_images_pair_with_rows_by_time(tmp_path: Path) -> None:
    """Names that are times pair with a column of times."""
    names = ["1682512345.000.png", "1682512346.010.png", "1682512350.000.png"]
    folder = photos(tmp_path / "p", names)
    rows = table(tmp_path / "t.csv", 3, "stamp_s", ["1682512346.0", "1682512345.02", "1682512348"])
    cell = str(tmp_path / "c")
    assert main(["import", "poses", cell, "--robot", "arm", rows, "--format", "ur"]) == 0
    assert main(["import", "images", cell, folder, "--camera", "cam", "--by", "time"]) == 0
    assert poses_by_image(tmp_path / "c") == {names[1]: 0, names[0]: 1}


def test_second_camera_pairs_in_order_and_links(tmp_path: Path) -> None:
    """Each camera is imported separately, in order though some names are equal. Linked images are not stored twice."""
    cell = str(tmp_path / "c")
    one, two = photos(tmp_path / "p", ["1.png", "2.png"]), photos(tmp_path / "q", ["2.png", "3.png"], (32, 24))
    assert main(["import", "images", cell, one, "--camera", "cam", "--on", "arm"]) == 0
    assert main(["import", "images", cell, two, "--camera", "door", "--on", "world", "--link"]) == 0
    samples = read_recording(cell).samples
    assert not os.path.samefile(tmp_path / "c" / samples[0].images["cam"], tmp_path / "p" / "1.png")
    assert [Path(s.images["door"]).name for s in samples] == ["2.png", "3.png"]
    assert os.path.samefile(tmp_path / "c" / samples[0].images["door"], tmp_path / "q" / "2.png")
    assert {name: c.size_px for name, c in read_cell(cell).cameras.items()} == {"cam": (64, 48), "door": (32, 24)}


def test_image_size_replaces_template_size(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The size that `basecal new` wrote is replaced before any image is recorded.

    Afterwards another size is an error.
    """
    cell = str(tmp_path / "c")
    main(["new", cell, "--robots", "1"])
    text = (tmp_path / "c" / "cell.yaml").read_text()
    assert main(["import", "images", cell, photos(tmp_path / "p", ["1.png"]), "--camera", "camera"]) == 0
    changed = (tmp_path / "c" / "cell.yaml").read_text()
    different = [(a, b) for a, b in zip(text.splitlines(), changed.splitlines(), strict=True) if a != b]
    assert len(different) == 1
    assert "size_px: [64, 48]" in different[0][1]
    other = photos(tmp_path / "q", ["9.png"], (32, 24))
    assert main(["import", "images", cell, other, "--camera", "camera"]) == 3
    assert "cameras.camera.size_px: is [64, 48], but [32, 24] in the imported data" in capsys.readouterr().err


def test_unusable_images_are_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Damaged images, another size and other file types are reported; the order of the rest is unaffected."""
    folder = Path(photos(tmp_path / "p", ["1.png", "2.png", "3.png"]))
    photos(folder, ["4.png"], (32, 24))
    (folder / "2.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (folder / "5.heic").write_bytes(b"x")
    assert main(["import", "images", str(tmp_path / "c"), str(folder), "--camera", "cam", "--on", "arm"]) == 0
    message = capsys.readouterr().err
    assert "left out, as they cannot be read: 2.png" in message
    assert "left out, as most images have another size: 4.png (32 x 24)" in message
    assert "left out, as they are not images: 5.heic" in message
    assert len(read_recording(tmp_path / "c").samples) == 4


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--camera", "cam"], "camera 'cam' is new: give its carrier with --on, one of: a robot"),
        (["--camera", "cam", "--on", "world"], "camera 'cam' on the world needs a robot"),
        (["--camera", "cam", "--on", "arm", "--by", "time"], "1.png: the name is not a time"),
        (["--camera", "Cam", "--on", "arm"], "expected a name of a-z"),
    ],
)
def test_invalid_image_imports_create_no_cell(
    tmp_path: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The error is one line, and no cell is created."""
    folder = photos(tmp_path / "p", ["1.png"])
    assert main(["import", "images", str(tmp_path / "c"), folder, *words]) == 3
    assert message in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_camera_carrier_is_requested_with_two_robots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The carrier must be given if there are two robots, and is implied by one.

    A carrier other than the cell's is an error.
    """
    cell, folder = str(tmp_path / "c"), photos(tmp_path / "p", ["1.png", "2.png"])
    rows = table(tmp_path / "t.csv", 2)
    for robot in ("arm", "other"):
        assert main(["import", "poses", cell, "--robot", robot, rows, "--format", "ur"]) == 0
    assert main(["import", "images", cell, folder, "--camera", "cam"]) == 3
    assert "give its carrier with --on, one of: arm, other, world" in capsys.readouterr().err
    assert main(["import", "images", cell, folder, "--camera", "cam", "--on", "other"]) == 0
    assert main(["import", "images", cell, folder, "--camera", "cam", "--on", "world"]) == 3
    assert "camera 'cam' is on 'other' in cell.yaml, not on 'world'" in capsys.readouterr().err


def test_real_recording_of_two_arms_is_imported(tmp_path: Path) -> None:
    """Published matrices and photographs of two UR5e give a recording with ten complete samples."""
    source = data_folder() / "ur5e_dual_charuco_2023"
    if not source.exists():
        pytest.skip(f"{source} is not there: set BASECAL_DATA to the folder of the published recordings")
    cell = str(tmp_path / "c")
    for robot, file in (("eye", "r2_tf.txt"), ("hand", "r1_tf.txt")):
        assert main(["import", "poses", cell, "--robot", robot, str(source / file), "--format", "matrix"]) == 0
    assert main(["import", "images", cell, str(source / "images"), "--camera", "wrist", "--on", "eye"]) == 0
    assert read_cell(cell).cameras["wrist"].size_px == (1280, 720)
    samples = read_recording(cell).samples
    assert [Path(sample.images["wrist"]).name for sample in samples] == [f"{i:03d}_image.jpg" for i in range(10)]
    assert all(sample.robots.keys() == {"eye", "hand"} for sample in samples)
