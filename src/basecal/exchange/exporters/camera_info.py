"""Export of a camera's lens as a calibration file of ROS, which is published as `sensor_msgs/CameraInfo`."""

from __future__ import annotations

import json

import numpy as np

from basecal.errors import InputError
from basecal.exchange.exports.cameras import choose_camera, exported_camera
from basecal.exchange.exports.exporter import Exporter, ExportRequest, comments, yaml_word
from basecal.exchange.lens_files.camera_info import ros_lens
from basecal.geometry import Array


def export_text(request: ExportRequest) -> str:
    """Format a file for `camera_info_url`, without rectification, and with the lens as the projection.

    Raises:
        FrameNotFound: if the camera does not exist.
        InputError: if the camera is ambiguous, its lens or image size is unknown, or ROS has no name for the lens.

    Source: github.com/ros-perception/image_common, camera_calibration_parsers.
    """
    name = choose_camera(request)
    camera = exported_camera(request, name)
    if camera.size_px is None:
        raise InputError(f"the image size of {name!r} is not known: write `size_px: [width, height]` in cell.yaml")
    model, distortion = ros_lens(camera)
    lines = [
        *comments(request.remarks, "#"),
        f"image_width: {camera.size_px[0]}",
        f"image_height: {camera.size_px[1]}",
        f"camera_name: {yaml_word(name)}",
        *_matrix("camera_matrix", camera.matrix),
        f"distortion_model: {model}",
        *_matrix("distortion_coefficients", distortion[None]),
        *_matrix("rectification_matrix", np.eye(3)),
        *_matrix("projection_matrix", np.pad(camera.matrix, ((0, 0), (0, 1)))),
    ]
    return "\n".join(lines) + "\n"


def _matrix(name: str, values: Array) -> list[str]:
    rows, columns = values.shape
    data = json.dumps([float(value) + 0.0 for value in values.ravel()])
    return [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: {data}"]


EXPORTER = Exporter("with --camera: its lens as a calibration file of ROS", export_text, options=("camera",))
