"""Tests of the export of OpenCV FileStorage."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from basecal.errors import InputError
from basecal.exchange.exporters import opencv
from basecal.exchange.exporters.opencv import export_text
from basecal.exchange.exports.exporter import ExportRequest
from basecal.exchange.importers.opencv import read_opencv_lens
from basecal.geometry import Camera
from export_example import BASE, CALIBRATION, all_poses, wanted


def storage(text):
    return cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)


@pytest.mark.parametrize("name", all_poses())
def test_opencv_reads_exported_transform(name):
    """OpenCV reads all digits, and its own rotation vector."""
    (one,) = wanted(name).transforms
    file = storage(export_text(wanted(name)))
    node = file.getNode(name)
    np.testing.assert_array_equal(node.getNode("R").mat(), one.estimate.mean.rotation)
    np.testing.assert_array_equal(node.getNode("t").mat()[:, 0], one.estimate.mean.translation)
    np.testing.assert_array_equal(node.getNode("T").mat(), one.estimate.mean.matrix)
    np.testing.assert_array_equal(node.getNode("covariance").mat(), one.estimate.covariance)
    np.testing.assert_allclose(cv2.Rodrigues(node.getNode("rvec").mat())[0], one.estimate.mean.rotation, atol=1e-12)


def test_opencv_projects_with_exported_lens():
    """OpenCV projects like the camera itself, to 1e-9 px."""
    lens = Camera("pinhole", np.array([800, 801, 320, 240, -0.1, 0.01, 1e-3, -1e-3, 0.02]), (640, 480))
    file = storage(
        export_text(ExportRequest((), (), replace(CALIBRATION, cameras={"wrist": (lens, np.eye(9))}), camera="wrist"))
    )
    assert (file.getNode("image_width").real(), file.getNode("image_height").real()) == (640, 480)
    points = np.random.default_rng(0).uniform([-0.3, -0.2, 1], [0.3, 0.2, 2], (20, 3))
    matrix, terms = (file.getNode(key).mat() for key in ("camera_matrix", "distortion_coefficients"))
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, terms)
    np.testing.assert_allclose(pixels[:, 0], lens.project(points), atol=1e-9)


@pytest.mark.parametrize("model", ["pinhole", "fisheye"])
def test_exported_lens_keeps_its_model(tmp_path, model):
    """Both models may have four terms, so the file names a fisheye lens."""
    lens = Camera(model, np.array([800, 801, 320, 240, -0.1, 0.01, 1e-3, -1e-3]), (640, 480))
    path = tmp_path / "lens.yml"
    path.write_text(
        export_text(ExportRequest((), (), replace(CALIBRATION, cameras={"wrist": (lens, np.eye(8))}), camera="wrist"))
    )
    found = read_opencv_lens(path).camera
    assert found.model == model
    np.testing.assert_array_equal(found.parameters, lens.parameters)


def test_several_transforms_are_separate_maps():
    """Several transforms are in one file."""
    both = replace(wanted(), transforms=(*wanted(BASE).transforms, *wanted("board_from_hand_flange").transforms))
    file = storage(export_text(both))  # its nodes are invalid after its deletion
    assert set(file.root().keys()) == {BASE, "board_from_hand_flange"}


def test_a_lens_of_another_model_is_refused(monkeypatch):
    """Its terms would be read as those of another lens."""
    camera = Camera("fisheye", np.array([600.0, 601.0, 320.0, 240.0, 0.1, 0.0, 0.0, 0.0]), (640, 480))
    request = ExportRequest((), (), replace(CALIBRATION, cameras={"wrist": (camera, np.eye(8))}), camera="wrist")
    assert "fisheye_model" in export_text(request)
    monkeypatch.setattr(opencv, "_MODELS", ("pinhole",))
    with pytest.raises(InputError, match="OpenCV has no fisheye lens; it has pinhole"):
        export_text(request)
