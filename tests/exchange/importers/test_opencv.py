"""Tests of `basecal import opencv`."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.cell.files import read_cell
from basecal.cli import main
from basecal.errors import DatasetError
from basecal.exchange.importers.opencv import read_opencv_lens
from lens_texts import OPENCV, reads_lens

MATRIX = np.array([[766.5, 0, 640.9], [0, 765.4, 358.8], [0, 0, 1]])
TERMS = np.array([[-0.35, 0.179, 0.001, -0.002, 0.03]])
EXPECTED = [766.5, 765.4, 640.9, 358.8, *TERMS[0]]


def test_lens_is_imported_into_new_cell(tmp_path: Path) -> None:
    """A camera of a new cell has the lens."""
    assert reads_lens(tmp_path, "opencv", "a.yml", OPENCV + "D: [0.1, -0.2, 0., 0.]\n")


def test_image_size_option_completes_archive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An archive has no size, so the option gives it; the option does not overrule a file's size."""
    np.savez(tmp_path / "l.npz", mtx=[[600, 0, 320], [0, 601, 240], [0, 0, 1]], dist=[0.1, 0, 0, 0, 0])
    words = ["import", "opencv", str(tmp_path / "c"), "--size-px", "640", "480"]
    assert main([*words, str(tmp_path / "l.npz")]) == 0
    assert read_cell(tmp_path / "c").cameras["camera"].size_px == (640, 480)
    (tmp_path / "a.yml").write_text(OPENCV.replace("640", "1280"))
    assert main([*words, str(tmp_path / "a.yml")]) == 3
    assert "a.yml is of 1280 x 480 px: omit --size-px" in capsys.readouterr().err


def write_storage(path: Path, **fields: object) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in fields.items():
        storage.write(name, value)
    storage.release()
    return path


@pytest.mark.parametrize("suffix", ["yml", "yaml", "xml", "json"])
@pytest.mark.parametrize(
    ("matrix", "terms"),
    [
        ("camera_matrix", "distortion_coefficients"),
        ("Camera_Matrix", "Distortion_Coefficients"),
        ("cameraMatrix", "distCoeffs"),
        ("K", "D"),
        ("mtx", "dist"),
    ],
)
def test_usual_field_names_are_read(tmp_path: Path, suffix: str, matrix: str, terms: str) -> None:
    """The names of OpenCV's samples and of most scripts are read, with a row or a column of terms."""
    fields = {"image_width": 1280, "image_height": 720, matrix: MATRIX, terms: TERMS.T}
    lens = read_opencv_lens(write_storage(tmp_path / f"c.{suffix}", **fields))
    np.testing.assert_array_equal(lens.camera.parameters, EXPECTED)
    assert (lens.camera.model, lens.camera.size_px) == ("pinhole", (1280, 720))


@pytest.mark.parametrize("names", [("mtx", "dist"), ("camera_matrix", "dist_coeffs"), ("K", "D")])
def test_numpy_archives_of_lenses_are_read(tmp_path: Path, names: tuple[str, str]) -> None:
    """The contents of `np.savez` of a calibration are read, with or without vectors of views.

    There is no size by default.
    """
    np.savez(tmp_path / "c.npz", **{names[0]: MATRIX, names[1]: TERMS, "rvecs": np.zeros((9, 3, 1)), "ret": 0.2})
    lens = read_opencv_lens(tmp_path / "c.npz")
    np.testing.assert_array_equal(lens.camera.parameters, EXPECTED)
    assert lens.camera.size_px is None
    np.savez(tmp_path / "s.npz", **{names[0]: MATRIX, names[1]: TERMS, "image_size": [1280, 720]})
    assert read_opencv_lens(tmp_path / "s.npz").camera.size_px == (1280, 720)


def test_camera_of_stereo_file_is_chosen(tmp_path: Path) -> None:
    """The user chooses a camera of a stereo calibration; without a choice both are named."""
    path = write_storage(tmp_path / "s.yml", M1=MATRIX, D1=TERMS, M2=2 * MATRIX - np.diag([0, 0, 1.0]), D2=TERMS)
    assert read_opencv_lens(path, number=2).camera.parameters[0] == 1533.0
    with pytest.raises(DatasetError, match=r"holds two cameras \(M1, D1, M2, D2\): choose --which 1"):
        read_opencv_lens(path)


def test_four_terms_are_fisheye_if_stated(tmp_path: Path) -> None:
    """The field of OpenCV's sample, or the user, states a fisheye; otherwise the terms are k1 k2 p1 p2."""
    terms = TERMS[:, :4]
    by_file = read_opencv_lens(write_storage(tmp_path / "f.yml", fisheye_model=1, camera_matrix=MATRIX, dist=terms))
    by_user = read_opencv_lens(write_storage(tmp_path / "p.yml", camera_matrix=MATRIX, dist=terms), "fisheye")
    numbers = dict(zip(("fx", "fy", "cx", "cy"), (600.0, 601.0, 320.0, 240.0), strict=True))
    by_name = read_opencv_lens(write_storage(tmp_path / "n.yml", fisheye_model=1, dist=terms, **numbers))
    assert by_file.camera.model == by_user.camera.model == by_name.camera.model == "fisheye"
    assert read_opencv_lens(tmp_path / "p.yml").camera.model == "pinhole"
    assert "fisheye of 4 distortion terms" in by_file.what


def test_nested_camera_mapping_is_read(tmp_path: Path) -> None:
    """A camera one level deeper, with nested rows, is read as in the JSON of scripts."""
    path = tmp_path / "c.json"
    path.write_text('{"intrinsic": {"camera_matrix": [[500, 0, 320], [0, 500, 240], [0, 0, 1]], "dist": [0, 0, 0, 0]}}')
    np.testing.assert_array_equal(read_opencv_lens(path).camera.parameters, [500, 500, 320, 240, 0, 0, 0, 0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\n", "has no camera matrix; it has a: expected camera_matrix, cameraMatrix, mtx or K, 3 x 3"),
        ("[1, 2]\n", "has no camera matrix; it has none"),
        ("camera_matrix: [500, 0, 320, 0, 500, 240, 0, 0]\n", "has no camera matrix"),
        ("mtx: [500, 0, 0, 0, 500, 0, 320, 240, 1]\n", ":1: mtx: is not a camera matrix.*is it transposed"),
        ("mtx: [500, 0, 320, 0, 500, 240, 0, 0, 1]\ndist: [1, 2, 3]\n", ":2: dist: has 3 distortion terms, expected 0"),
        ("mtx: [500, 0, 320, 0, 500, 240, 0, 0, 1]\ndist: [1, x, 3, 4]\n", r"dist\[1\]: is 'x', expected a number"),
        (
            "mtx: [500, 0, 320, 0, 500, 240, 0, 0, 1]\ndist: {rows: 1, cols: 5, data: [0.1, 0, 0, 0]}\n",
            ":2: dist: has 4 numbers, its rows and cols state 1 x 5: is it cut off",
        ),
        ("camera_matrix: [1]\ndistortion_model: equidistant\n", "basecal import camera-info"),
    ],
)
def test_files_without_lens_are_reported(tmp_path: Path, text: str, message: str) -> None:
    """The error states the contents of the file and what was expected."""
    path = tmp_path / "c.yml"
    path.write_text("%YAML:1.0\n---\n" + text if "[1, 2]" in text else text)
    with pytest.raises(DatasetError, match=message):
        read_opencv_lens(path)
