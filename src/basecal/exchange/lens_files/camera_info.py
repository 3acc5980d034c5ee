"""Lenses of ROS: a `camera_info` file, or a `sensor_msgs/CameraInfo` printed by `topic echo`.

The terms of `plumb_bob` and `rational_polynomial` are in OpenCV's order (k1 k2 p1 p2 k3 ...), those of `equidistant`
are the fisheye's. The centre of the top-left pixel is (0, 0). The matrix is valid for the full sensor, not for images
that were binned or cropped afterwards.
Source: REP 104; sensor_msgs/CameraInfo.msg and distortion_models.hpp; camera_calibration_parsers of image_common.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from basecal.errors import DatasetError, InputError, count_text, list_names
from basecal.exchange.fields import Field, read_fields
from basecal.exchange.importing.lens import StatedLens, make_camera, matrix_parameters, opencv_terms
from basecal.geometry import Array, Camera
from basecal.geometry.lenses import fisheye, pinhole


class RosLens(NamedTuple):
    """A lens of ROS: its name in ROS, the model in basecal, and its number of distortion terms."""

    name: str
    model: str
    terms: int


ROS_LENSES = (
    RosLens("plumb_bob", pinhole.MODEL, 5),
    RosLens("rational_polynomial", pinhole.MODEL, 8),
    RosLens("equidistant", fisheye.MODEL, 4),
)

# Models by name, including obsolete names of ROS and an empty name.
_MODELS = {
    **{lens.name: lens.model for lens in ROS_LENSES},
    **dict.fromkeys(("thin_prism", ""), pinhole.MODEL),
    "fisheye": fisheye.MODEL,
}

_FISHEYE_TERMS = 4

_EXPECTED = "a camera_info file of ROS has image_width, image_height, camera_matrix, distortion_model"


def read_camera_info(path: str | Path) -> StatedLens:
    """Read the lens of a `camera_info` YAML.

    Raises:
        DatasetError: if the file is invalid, the camera is not calibrated, or the lens or image part is not supported.
    """
    return camera_info_lens(read_fields(path))


def camera_info_lens(root: Field) -> StatedLens:
    """Convert the fields of a camera_info to a lens; see `read_camera_info`."""
    try:
        matrix = root.find("camera_matrix", "K", "k")
    except DatasetError as error:
        raise root.error(f"{error.reason}: {_EXPECTED}") from None
    size = (root.find("image_width", "width").integer(), root.find("image_height", "height").integer())
    _check_full_image(root, size)
    kind = root.first("distortion_model")
    named = "" if kind is None else kind.text()
    terms = root.first("distortion_coefficients", "D", "d")
    values = [] if terms is None else terms.matrix()
    parameters = matrix_parameters(matrix, matrix.matrix(9))
    if named not in _MODELS:
        known = list_names(sorted(_MODELS.keys() - {""}))
        raise root.find("distortion_model").error(f"{named!r} is not supported; there are: {known}")
    is_fisheye = _MODELS[named] == fisheye.MODEL
    if is_fisheye and len(values) != _FISHEYE_TERMS:
        raise root.error(f"{count_text(len(values), 'distortion coefficient')}, {named} has {_FISHEYE_TERMS}")
    distortion = values if is_fisheye else opencv_terms(terms or root, values)
    camera = make_camera(matrix, _MODELS[named], [*parameters, *distortion], size)
    name = root.first("camera_name")
    return StatedLens(
        camera,
        f"camera_info of ROS, {named or 'no distortion model'}, {size[0]} x {size[1]} px, the centre of the top-left "
        "pixel is (0, 0)",
        None if name is None else str(name.data),
    )


def _check_full_image(root: Field, size: tuple[int, int]) -> None:
    """Check that the images show the full sensor.

    Raises:
        DatasetError: if the images are binned or cropped.
    """
    for axis in ("binning_x", "binning_y"):
        if (binning := root.first(axis)) is not None and binning.integer(0) > 1:
            raise binning.error("the matrix is of the full image, the images are binned: give the matrix of the images")
    if (part := root.first("roi")) is not None:
        sides = tuple(part.find(side).integer(0) for side in ("width", "height"))
        if all(sides) and sides != size:
            raise part.error("the matrix is of the full image, the images are cropped: give the matrix of the images")


def ros_lens(camera: Camera) -> tuple[str, Array]:
    """Name and distortion terms of a lens in ROS; missing terms are zero.

    Raises:
        InputError: if ROS has no such lens.
    """
    count = len(camera.distortion)
    for lens in ROS_LENSES:
        if lens.model == camera.model and count <= lens.terms:
            return lens.name, np.concatenate([camera.distortion, np.zeros(lens.terms - count)])
    names = ", ".join(lens.name for lens in ROS_LENSES)
    raise InputError(
        f"ROS has no name for a {camera.model} lens with {count_text(count, 'distortion term')}; it has {names}"
    )
