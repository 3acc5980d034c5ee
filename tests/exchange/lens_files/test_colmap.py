"""Tests of COLMAP's cameras in text and binary layout, by its "Output Format" and src/colmap/sensor/models.h."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange.lens_files.colmap import read_colmap_lenses

TEXT = """\
# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 4
1 SIMPLE_PINHOLE 3072 2304 2559.81 1536 1152
2 PINHOLE 3072 2304 2560.56 2561.56 1536 1152
3 SIMPLE_RADIAL 3072 2304 2559.69 1536 1152 -0.0218531
7 OPENCV_FISHEYE 800 600 300 301 400 300 0.1 0.02 0.003 0.0004
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "cameras.txt"
    path.write_text(text, encoding="utf-8")
    return path


def test_pixel_centre_convention_is_converted(tmp_path: Path) -> None:
    """The middle of an image 3072 wide is 1536 for COLMAP and 1535.5 here.

    A single focal length applies to both axes.
    """
    lenses = read_colmap_lenses(write(tmp_path, TEXT))
    assert list(lenses) == [1, 2, 3, 7]
    np.testing.assert_array_equal(lenses[1].camera.parameters, [2559.81, 2559.81, 1535.5, 1151.5])
    np.testing.assert_array_equal(lenses[2].camera.parameters, [2560.56, 2561.56, 1535.5, 1151.5])
    assert lenses[3].camera.size_px == (3072, 2304)
    np.testing.assert_array_equal(lenses[3].camera.distortion, [-0.0218531, 0, 0, 0])
    assert "Half a pixel" in lenses[1].what


# fx fy cx cy and terms in OpenCV's convention, for each of COLMAP's models.
POINTS = np.random.default_rng(3).uniform([-0.5, -0.4, 1.0], [0.5, 0.4, 2.0], (20, 3))


@pytest.mark.parametrize(
    ("model", "parameters", "terms"),
    [
        ("RADIAL", "800 320 240 0.1 -0.05", [0.1, -0.05, 0, 0]),
        ("OPENCV", "800 800 320 240 0.1 -0.05 0.001 -0.002", [0.1, -0.05, 0.001, -0.002]),
        (
            "FULL_OPENCV",
            "800 800 320 240 0.1 -0.05 0.001 -0.002 0.03 0.2 0.01 -0.02",
            [0.1, -0.05, 0.001, -0.002, 0.03, 0.2, 0.01, -0.02],
        ),
    ],
)
def test_projections_match_opencv(tmp_path: Path, model: str, parameters: str, terms: list[float]) -> None:
    """OpenCV's own projection confirms that the terms are in OpenCV's order."""
    camera = read_colmap_lenses(write(tmp_path, f"1 {model} 640 480 {parameters}\n"))[1].camera
    matrix = np.array([[800, 0, 319.5], [0, 800, 239.5], [0, 0, 1.0]])
    expected, _ = cv2.projectPoints(POINTS, np.zeros(3), np.zeros(3), matrix, np.array(terms))
    np.testing.assert_allclose(camera.project(POINTS), expected[:, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("model", "parameters", "terms"),
    [
        ("OPENCV_FISHEYE", "300 300 400 300 0.1 0.02 0.003 0.0004", [0.1, 0.02, 0.003, 0.0004]),
        ("SIMPLE_RADIAL_FISHEYE", "300 400 300 0.1", [0.1, 0, 0, 0]),
        ("RADIAL_FISHEYE", "300 400 300 0.1 0.02", [0.1, 0.02, 0, 0]),
    ],
)
def test_fisheye_projections_match_opencv(tmp_path: Path, model: str, parameters: str, terms: list[float]) -> None:
    """Lenses that are OpenCV's fisheye with all or some of its terms agree, too."""
    camera = read_colmap_lenses(write(tmp_path, f"1 {model} 800 600 {parameters}\n"))[1].camera
    matrix = np.array([[300, 0, 399.5], [0, 300, 299.5], [0, 0, 1.0]])
    zero = np.zeros((3, 1))
    expected, _ = cv2.fisheye.projectPoints(POINTS[:, None], zero, zero, matrix, np.array(terms))
    np.testing.assert_allclose(camera.project(POINTS), expected[:, 0], atol=1e-9)


def binary(*cameras: tuple[int, int, int, int, tuple[float, ...]]) -> bytes:
    body = b"".join(struct.pack(f"<iiQQ{len(p)}d", number, model, w, h, *p) for number, model, w, h, p in cameras)
    return struct.pack("<Q", len(cameras)) + body


def test_binary_cameras_equal_text(tmp_path: Path) -> None:
    """The binary has model numbers instead of names, and is preferred in a folder."""
    content = binary((3, 2, 640, 480, (500.0, 320.0, 240.0, -0.02)), (4, 1, 640, 480, (500.0, 501.0, 320.0, 240.0)))
    (tmp_path / "cameras.bin").write_bytes(content)
    write(tmp_path, TEXT)
    lenses = read_colmap_lenses(tmp_path)
    assert list(lenses) == [3, 4]
    np.testing.assert_array_equal(lenses[3].camera.parameters, [500, 500, 319.5, 239.5, -0.02, 0, 0, 0])
    for end in (4, 20, 40, len(content) - 1):
        (tmp_path / "cameras.bin").write_bytes(content[:end])
        with pytest.raises(DatasetError, match="is cut off"):
            read_colmap_lenses(tmp_path / "cameras.bin")
    (tmp_path / "cameras.bin").write_bytes(binary((1, 99, 640, 480, (1.0,))))
    with pytest.raises(DatasetError, match="camera 0: is of model 99, expected 0 to 11"):
        read_colmap_lenses(tmp_path / "cameras.bin")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1 FOV 640 480 500 500 320 240 0.9", ":1: FOV is not supported: calibrate with OPENCV or OPENCV_FISHEYE"),
        ("1 THIN_PRISM_FISHEYE 640 480 " + "1 " * 12, "THIN_PRISM_FISHEYE is not supported"),
        ("1 OPENCVV 640 480 1 1 1 1", r"no model 'OPENCVV' \(did you mean 'OPENCV'\?\)"),
        ("1 PINHOLE 640 480 500 320 240", "3 parameters, PINHOLE has 4"),
        ("1 PINHOLE 640 480", "4 words, expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS"),
        ("1 PINHOLE 640 480 five 500 320 240", "has a word that is not a number"),
        ("1 PINHOLE 640 480 nan 500 320 240", "is nan, expected a number"),
        ("1 PINHOLE 640 480 -500 500 320 240", "the focal lengths are -500 and 500 px"),
        ("1 PINHOLE 640 480 5_00 500 320 240", "has a word that is not a number"),
        ("1 PINHOLE 640 480 500 500 320 240\n1 PINHOLE 640 480 600 600 320 240", ":2: camera 1 is given twice"),
        ("# nothing", "holds no camera"),
    ],
)
def test_unsupported_colmap_models_are_reported(tmp_path: Path, line: str, message: str) -> None:
    """The error has the model's name and the line."""
    with pytest.raises(DatasetError, match=message):
        read_colmap_lenses(write(tmp_path, line + "\n"))


def test_folder_without_cameras_is_refused(tmp_path: Path) -> None:
    """The error names the files that a reconstruction contains."""
    with pytest.raises(DatasetError, match=r"holds neither cameras.bin nor cameras.txt"):
        read_colmap_lenses(tmp_path)


@pytest.mark.parametrize(("number", "name", "count"), [
    (0, "SIMPLE_PINHOLE", 3), (1, "PINHOLE", 4), (2, "SIMPLE_RADIAL", 4), (3, "RADIAL", 5), (4, "OPENCV", 8),
    (5, "OPENCV_FISHEYE", 8), (6, "FULL_OPENCV", 12), (8, "SIMPLE_RADIAL_FISHEYE", 4), (9, "RADIAL_FISHEYE", 5),
    (7, "FOV", 5), (10, "THIN_PRISM_FISHEYE", 12), (11, "RAD_TAN_THIN_PRISM_FISHEYE", 16),
])  # fmt: skip
def test_model_numbers_match_colmap(tmp_path: Path, number: int, name: str, count: int) -> None:
    """The binary number and the text name of a model are equivalent, also for unsupported models."""
    parameters = tuple([500.0] * 2 + [0.01] * (count - 2)) if count > 3 else (500.0, 320.0, 240.0)
    (tmp_path / "cameras.bin").write_bytes(
        binary((1, number, 640, 480, parameters), (2, 0, 640, 480, (500.0, 320.0, 240.0)))
    )
    text = write(tmp_path, f"1 {name} 640 480 {' '.join(map(str, parameters))}\n")
    if number in (7, 10, 11):
        for file in (tmp_path / "cameras.bin", text):
            with pytest.raises(DatasetError, match=f"{name} is not supported"):
                read_colmap_lenses(file)
        return
    one, other = read_colmap_lenses(tmp_path / "cameras.bin"), read_colmap_lenses(text)[1]
    assert one[1].camera.model == other.camera.model
    np.testing.assert_array_equal(one[1].camera.parameters, other.camera.parameters)
    assert one[2].camera.parameters[0] == 500
