"""Tests of common mistakes in tables and file names, each reported with its fix before any file is written."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.errors import DatasetError, InputError
from basecal.exchange.images import missing_numbers
from basecal.exchange.importers.opencv import read_opencv
from basecal.exchange.importers.poses import read_poses
from basecal.geometry import SE3

POSES = SE3.exp(np.random.default_rng(0).normal(size=(5, 6)) * 0.4)
UR = "".join(f"{', '.join(map(repr, [*p.translation.tolist(), *p.rotvec.tolist()]))}\n" for p in POSES)
KUKA = "".join(
    f"{', '.join(map(repr, [*(1e3 * p.translation).tolist(), *np.degrees(p.rpy[::-1]).tolist()]))}\n" for p in POSES
)
MATRICES = [pose.matrix for pose in POSES]


def table(folder: Path, text: str, name: str = "poses.csv") -> str:
    (folder / name).write_text(text)
    return str(folder / name)


def rows_of(matrices: list[np.ndarray]) -> str:
    return "".join(", ".join(map(repr, matrix.ravel().tolist())) + "\n" for matrix in matrices)


@pytest.mark.parametrize(
    ("text", "form", "message"),
    [
        (KUKA, "ur", "They look like millimetres and degrees: give --length-unit mm --deg, or --format kuka, "),
        (UR, "kuka", "They look like metres and radians: give --length-unit m --rad, or --format ur"),
        (rows_of(MATRICES), "franka", "it is written by rows, give --format matrix"),
        ("x y z rx ry rz\n1,234.5 0 0 0 0 0\n", "ur", "thousands separators"),
        ("x,y,z,rx,ry,rz\n0,1,0,2,0,3,0,0,0,5,1\n", "ur", "decimal commas need another separator"),
    ],
)
def test_table_mistakes_are_reported_with_fix(tmp_path: Path, text: str, form: str, message: str) -> None:
    """A file of another controller, matrices by rows, and commas with another meaning are reported."""
    with pytest.raises(DatasetError, match=message):
        read_poses(tmp_path, table(tmp_path, text, "poses.txt"), robot="arm", format=form)


@pytest.mark.parametrize("image", ["image", ""])
def test_transposed_matrices_are_refused(tmp_path: Path, image: str) -> None:
    """A transposed matrix has 0 0 0 1 in its last column, with image names and without."""
    text = ",".join(([image] if image else []) + [f"m{i}{j}" for i in range(4) for j in range(4)]) + "\n"
    for k, row in enumerate(rows_of([m.T for m in MATRICES]).splitlines()):
        text += f"{k}.png,{row}\n" if image else f"{row}\n"
    with pytest.raises(InputError, match="it is transposed, give --format franka"):
        read_poses(tmp_path, table(tmp_path, text), robot="arm", format="matrix")


def test_matrix_rows_pair_by_image_column(tmp_path: Path) -> None:
    """A column `image` beside m00 ... m23 pairs each row."""
    text = "image," + ",".join(f"m{i}{j}" for i in range(3) for j in range(4)) + "\n"
    text += "".join(f"{k:04}.png,{row}\n" for k, row in enumerate(rows_of([m[:3] for m in MATRICES]).splitlines()))
    found = read_poses(tmp_path, table(tmp_path, text), robot="arm", format="matrix")
    assert [row.image for row in found.rows] == [f"{k:04}.png" for k in range(5)]
    np.testing.assert_allclose(found.rows[3].robots["arm"].base_from_flange.matrix, POSES[3].matrix, atol=1e-12)


@pytest.mark.parametrize("header", ["Bild", "anything"])
def test_any_column_of_images_pairs_rows(tmp_path: Path, header: str) -> None:
    """The column may have any name."""
    text = f"{header},x,y,z,rx,ry,rz\n" + "".join(f"p{k}.png,{row}\n" for k, row in enumerate(UR.splitlines()))
    found = read_poses(tmp_path, table(tmp_path, text), robot="arm", format="ur")
    assert [row.image for row in found.rows] == [f"p{k}.png" for k in range(5)]


def test_damaged_spreadsheet_is_refused(tmp_path: Path) -> None:
    """The error advises to save the file as CSV."""
    (tmp_path / "poses.xlsx").write_bytes(b"PK\x03\x04" + bytes(100))
    with pytest.raises(DatasetError, match="save it as CSV"):
        read_poses(tmp_path, str(tmp_path / "poses.xlsx"), robot="arm", format="ur")


def test_stationary_arm_applies_to_every_sample(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its single row applies to every sample; different rows, or no samples to pair with, are refused."""
    cell = str(tmp_path / "cell")
    still = ["import", "poses", cell, table(tmp_path, UR.splitlines()[0], "one.txt"), "--robot", "b", "--format", "ur"]
    assert main([*still, "--still"]) == 3
    assert "import the moving robots" in capsys.readouterr().err
    moving = ["import", "poses", cell, table(tmp_path, UR, "all.txt"), "--format", "ur"]
    assert main([*moving, "--robot", "a"]) == 0
    assert main([*still, "--still"]) == 0
    described = read_cell(cell)
    states = [sample.robots["b"].base_from_flange for sample in read_recording(cell, described).samples]
    np.testing.assert_allclose(SE3.stack(states).matrix, np.broadcast_to(POSES[0].matrix, (5, 4, 4)), atol=1e-9)
    assert main([*moving, "--robot", "c", "--still"]) == 3
    assert "holds 5 rows that differ" in capsys.readouterr().err


def test_rows_in_another_unit_are_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They are reported by their lines, and no files are written."""
    rows = UR.splitlines()
    numbers = [float(cell) for cell in rows[2].split(",")]
    rows[2] = ", ".join(map(repr, [1e3 * 10 * value for value in numbers[:3]] + numbers[3:]))
    words = ["import", "poses", str(tmp_path / "cell"), table(tmp_path, "\n".join(rows)), "--robot", "arm"]
    assert main([*words, "--format", "ur"]) == 3
    message = capsys.readouterr().err
    assert "another length unit? Correct line 3; nothing is imported" in message


def test_missing_image_number_is_found() -> None:
    """A missing number among numbered images is found; names without numbers have none."""
    assert missing_numbers([f"{k:02}.png" for k in range(12) if k != 7]) == ("07",)
    assert missing_numbers(["a.png", "b.png", "c.png"]) == ()
    assert missing_numbers(["1.png", "1000.png", "2000.png"]) == ()


def test_lens_parameters_by_name_are_read(tmp_path: Path) -> None:
    """fx, fy, cx, cy and terms are read by their names."""
    (tmp_path / "cell").mkdir()
    text = (
        "width: 640\nheight: 480\nfx: 600.0\nfy: 601.0\ncx: 320.0\ncy: 240.0\nk1: -0.1\nk2: 0.01\np1: 0.0\np2: 0.001\n"
    )
    found = read_opencv(tmp_path / "cell", table(tmp_path, text, "camera.yaml"), camera="wrist", on="arm")
    lens = found.cell["cameras"]["wrist"]["intrinsics"]
    assert (lens["fx"], lens["cy"], lens["distortion"][0]) == (600.0, 240.0, -0.1)


def test_repeated_detections_become_samples(tmp_path: Path) -> None:
    """Each detection of one stop makes its own sample with the robot's pose of the first.

    So few are not checked for consistency.
    """
    cell = str(tmp_path / "cell")
    poses = ["import", "poses", cell, "--robot", "arm", table(tmp_path, UR, "arm.txt"), "--format", "ur"]
    assert main(poses) == 0
    text = "sample,x,y,z,qx,qy,qz,qw\n"
    text += "".join(f"{sample},0,0,0.{k + 3},0,0,0,1\n" for k, sample in enumerate((0, 0, 0, 1)))
    seen = ["import", "poses", cell, table(tmp_path, text, "tag.csv"), "--camera", "wrist", "--target", "tag"]
    assert main([*seen, "--on", "arm", "--format", "ros"]) in (0, 1)
    samples = read_recording(cell, read_cell(cell)).samples
    assert [len(sample.observations) for sample in samples] == [1, 1, 0, 0, 0, 1, 1]
    stands = [sample.robots["arm"].base_from_flange.matrix for sample in samples]
    np.testing.assert_allclose(stands[5:], np.repeat(POSES.matrix[:1], 2, axis=0), atol=1e-12)


def test_missing_image_is_reported_by_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """If there are fewer images than rows, the missing number is reported."""
    cell, photos = str(tmp_path / "cell"), tmp_path / "photos"
    photos.mkdir()
    for k in (1, 2, 4, 5):
        cv2.imwrite(str(photos / f"IMG_{k:03d}.png"), np.zeros((48, 64), np.uint8))
    assert main(["import", "poses", cell, "--robot", "arm", table(tmp_path, UR, "arm.txt"), "--format", "ur"]) == 0
    assert main(["import", "images", cell, str(photos), "--camera", "wrist"]) == 3
    assert "003 missing in the numbering of its images" in capsys.readouterr().err
