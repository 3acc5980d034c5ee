"""Tests of the export of ROS camera calibration files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ruamel.yaml import YAML

from basecal.errors import InputError
from basecal.exchange.exporters.camera_info import export_text
from basecal.exchange.exports.exporter import ExportRequest
from basecal.exchange.lens_files.camera_info import read_camera_info
from basecal.geometry import Camera
from export_example import CALIBRATION

LENS = Camera("pinhole", np.array([800.123456789, 801, 320, 240, -0.1, 0.01, 1e-5, -1e-5]), (640, 480))


def of(camera):
    return ExportRequest((), ("made by",), replace(CALIBRATION, cameras={"wrist": (camera, np.eye(8))}))


def test_camera_info_restores_lens():
    """A YAML parser reads the fields of camera_calibration_parsers with the lens's values."""
    read = YAML(typ="safe", pure=True).load(export_text(of(LENS)))
    assert (read["image_width"], read["image_height"], read["camera_name"]) == (640, 480, "wrist")
    assert read["distortion_model"] == "plumb_bob"
    matrix = np.reshape(read["camera_matrix"]["data"], (3, 3))
    np.testing.assert_array_equal(matrix, [[800.123456789, 0, 320], [0, 801, 240], [0, 0, 1]])
    np.testing.assert_array_equal(read["distortion_coefficients"]["data"], [-0.1, 0.01, 1e-5, -1e-5, 0])
    np.testing.assert_array_equal(np.reshape(read["rectification_matrix"]["data"], (3, 3)), np.eye(3))
    np.testing.assert_array_equal(np.reshape(read["projection_matrix"]["data"], (3, 4))[:, :3], matrix)
    for key in ("camera_matrix", "distortion_coefficients", "rectification_matrix", "projection_matrix"):
        assert read[key]["rows"] * read[key]["cols"] == len(read[key]["data"])


def test_negative_zeros_are_not_written():
    """Some readers keep the sign of a negative zero, and write it on."""
    lens = Camera("pinhole", np.append(LENS.parameters[:4], [-0.0, 0.01, -0.0, 0.0]), LENS.size_px)
    text = export_text(of(lens))
    assert "-0.0," not in text
    assert "data: [0.0, 0.01, 0.0, 0.0" in text


def test_unknown_image_size_is_refused():
    """ROS requires the image size."""
    with pytest.raises(InputError, match="image size of 'wrist' is not known"):
        export_text(of(Camera("pinhole", LENS.parameters)))


@pytest.mark.parametrize(("model", "terms"), [("pinhole", 5), ("pinhole", 8), ("fisheye", 4)])
def test_exported_camera_info_is_imported_again(model, terms, tmp_path):
    """The own import reads the same lens."""
    camera = Camera(model, np.array([800.5, 801, 320, 240, *(0.01 * np.arange(1, terms + 1))]), (640, 480))
    path = tmp_path / "ost.yaml"
    path.write_text(export_text(of(camera)))
    read = read_camera_info(path)
    assert (read.camera.model, read.camera.size_px) == (model, (640, 480))
    np.testing.assert_array_equal(read.camera.parameters, camera.parameters)
