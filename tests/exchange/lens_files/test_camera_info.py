"""Tests of ROS camera_info in the layouts of camera_calibration_parsers and `ros2 topic echo`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.errors import DatasetError, InputError
from basecal.exchange.lens_files.camera_info import read_camera_info, ros_lens
from basecal.geometry import Camera

FILE = """\
image_width: 1280
image_height: 720
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [766.5, 0, 640.9, 0, 765.4, 358.8, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.35, 0.179, 0.001, -0.002, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [700, 0, 641, 0, 0, 730, 357, 0, 0, 0, 1, 0]
"""
MESSAGE = """\
header:
  stamp: {sec: 1700000000, nanosec: 5}
  frame_id: camera_color_optical_frame
height: 480
width: 640
distortion_model: rational_polynomial
d:
- 0.5
- -2.6
- 0.0008
- -0.0003
- 1.5
- 0.38
- -2.4
- 1.4
k: [610.1, 0.0, 322.3, 0.0, 609.9, 245.0, 0.0, 0.0, 1.0]
r: [1, 0, 0, 0, 1, 0, 0, 0, 1]
p: [610.1, 0, 322.3, 0, 0, 609.9, 245.0, 0, 0, 0, 1, 0]
binning_x: 0
binning_y: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
---
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "ost.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_camera_info_file_is_read(tmp_path: Path) -> None:
    """The matrix and coefficients are read unchanged, not the projection of rectified images, with size and name."""
    lens = read_camera_info(write(tmp_path, FILE))
    assert (lens.name, lens.camera.model, lens.camera.size_px) == ("narrow_stereo", "pinhole", (1280, 720))
    expected = [766.5, 765.4, 640.9, 358.8, -0.35, 0.179, 0.001, -0.002, 0]
    np.testing.assert_array_equal(lens.camera.parameters, expected)
    assert "top-left pixel is (0, 0)" in lens.what


def test_printed_camera_info_message_is_read(tmp_path: Path) -> None:
    """Lower and upper case, eight terms, and the trailing separator are read."""
    lens = read_camera_info(write(tmp_path, MESSAGE))
    np.testing.assert_array_equal(lens.camera.parameters[:5], [610.1, 609.9, 322.3, 245.0, 0.5])
    assert (len(lens.camera.distortion), lens.camera.size_px) == (8, (640, 480))
    capitals = MESSAGE.replace("\nk:", "\nK:").replace("\nd:", "\nD:")
    np.testing.assert_array_equal(read_camera_info(write(tmp_path, capitals)).camera.parameters, lens.camera.parameters)


@pytest.mark.parametrize("name", ["equidistant", "fisheye"])
def test_equidistant_lens_is_fisheye(tmp_path: Path, name: str) -> None:
    """The four terms of an equidistant lens are the fisheye's."""
    text = FILE.replace("plumb_bob", name).replace("data: [-0.35, 0.179, 0.001, -0.002, 0]", "data: [0.1, 0, 0.02, 0]")
    lens = read_camera_info(write(tmp_path, text))
    assert lens.camera.model == "fisheye"
    np.testing.assert_array_equal(lens.camera.distortion, [0.1, 0, 0.02, 0])


def test_empty_distortion_is_read(tmp_path: Path) -> None:
    """An empty list of terms without a model is a lens without distortion."""
    text = MESSAGE.replace("distortion_model: rational_polynomial", "distortion_model: ''")
    start, end = text.index("d:\n-"), text.index("k: [")
    lens = read_camera_info(write(tmp_path, text[:start] + "d: []\n" + text[end:]))
    assert len(lens.camera.distortion) == 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("data: [766.5, 0, 640.9, 0, 765.4, 358.8, 0, 0, 1]", "data: [0, 0, 0, 0, 0, 0, 0, 0, 0]", "is not calibrated"),
        (
            "data: [766.5, 0, 640.9, 0, 765.4, 358.8, 0, 0, 1]",
            "data: [766.5, 0]",
            ":7: camera_matrix.data: has 2 numbers",
        ),
        (
            "plumb_bob",
            "double_sphere",
            ":8: distortion_model: 'double_sphere' is not supported; there are: equidistant",
        ),
        ("plumb_bob", "equidistant", "5 distortion coefficients, equidistant has 4"),
        ("image_width: 1280", "image_width: wide", ":1: image_width: is 'wide', expected a number"),
        ("image_width: 1280\n", "", "has no image_width or width"),
        ("camera_matrix:", "matrix:", r"has no camera_matrix or K or k.* a camera_info file of ROS has image_width"),
        (
            "data: [-0.35, 0.179, 0.001, -0.002, 0]",
            "data: [-0.35, .nan, 0, 0, 0]",
            "data.1.: is nan, expected a number",
        ),
    ],
)
def test_invalid_camera_info_is_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    """The error has path, line, field and the expected value on one line."""
    assert old in FILE
    with pytest.raises(DatasetError, match=message) as caught:
        read_camera_info(write(tmp_path, FILE.replace(old, new)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("binning_x: 0", "binning_x: 2"),
        ("height: 0, width: 0", "height: 240, width: 320"),
    ],
)
def test_binned_and_cropped_images_are_refused(tmp_path: Path, old: str, new: str) -> None:
    """The matrix does not apply to binned or cropped images."""
    assert old in MESSAGE
    with pytest.raises(DatasetError, match="give the matrix of the images"):
        read_camera_info(write(tmp_path, MESSAGE.replace(old, new)))


@pytest.mark.parametrize(
    ("model", "terms", "name", "count"),
    [
        ("pinhole", 0, "plumb_bob", 5),
        ("pinhole", 4, "plumb_bob", 5),
        ("pinhole", 5, "plumb_bob", 5),
        ("pinhole", 8, "rational_polynomial", 8),
        ("fisheye", 4, "equidistant", 4),
    ],
)
def test_missing_ros_terms_are_zero(model, terms, name, count):
    """The other terms keep their order."""
    distortion = 0.01 * np.arange(1, terms + 1)
    named, full = ros_lens(Camera(model, np.concatenate([[800, 800, 320, 240], distortion])))
    assert (named, len(full)) == (name, count)
    np.testing.assert_array_equal(full[:terms], distortion)
    assert not np.any(full[terms:])


def test_lens_unknown_to_ros_is_refused():
    """ROS has no name for a thin-prism lens."""
    with pytest.raises(InputError, match="ROS has no name for a pinhole lens with 12"):
        ros_lens(Camera("pinhole", np.array([800, 800, 320, 240, *np.full(12, 0.01)])))
