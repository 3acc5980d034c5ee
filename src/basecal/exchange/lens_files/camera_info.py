"""The lens in a `camera_info` file of ROS, and in a `sensor_msgs/CameraInfo` that `topic echo` printed.

The terms of `plumb_bob` and `rational_polynomial` are in OpenCV's order (k1 k2 p1 p2 k3 ...), those of `equidistant`
are the fisheye's. The centre of the top-left pixel is (0, 0). The matrix is of the whole sensor: images that are binned
or cropped afterwards have another one.
Source: REP 104; sensor_msgs/CameraInfo and sensor_msgs/distortion_models; camera_calibration_parsers of image_common.
"""

from __future__ import annotations

from pathlib import Path

from basecal.errors import DatasetError, list_names
from basecal.exchange.fields import Field, read_fields
from basecal.exchange.lens_files.stated_lens import StatedLens, made_camera, matrix_parameters, opencv_terms

_FISHEYE = {"equidistant", "fisheye"}
_PINHOLE = {"plumb_bob", "rational_polynomial", "thin_prism", ""}
_FISHEYE_TERMS = 4
_EXPECTED = "a camera_info file of ROS has image_width, image_height, camera_matrix, distortion_model"


def read_camera_info(path: str | Path) -> StatedLens:
    """The lens of a `camera_info` YAML.

    Raises:
        DatasetError: if it is none, is not calibrated, or is of a lens or a part of an image that has no equal here.
    """
    return camera_info_lens(read_fields(path))


def camera_info_lens(root: Field) -> StatedLens:
    """The lens of the fields of a camera_info; likewise."""
    try:
        matrix = root.find("camera_matrix", "K", "k")
    except DatasetError as error:
        raise root.error(f"{error.reason}: {_EXPECTED}") from None
    size = (root.find("image_width", "width").integer(), root.find("image_height", "height").integer())
    _refuse_parts(root, size)
    kind = root.first("distortion_model")
    named = "" if kind is None else kind.text()
    terms = root.first("distortion_coefficients", "D", "d")
    values = [] if terms is None else terms.matrix()
    parameters = matrix_parameters(matrix, matrix.matrix(9))
    if named in _FISHEYE:
        if len(values) != _FISHEYE_TERMS:
            raise root.error(f"{len(values)} distortion coefficients, {named} has {_FISHEYE_TERMS}")
        camera = made_camera(matrix, "fisheye", [*parameters, *values], size)
    elif named in _PINHOLE:
        camera = made_camera(matrix, "pinhole", [*parameters, *opencv_terms(terms or root, values)], size)
    else:
        known = list_names(sorted((_PINHOLE | _FISHEYE) - {""}))
        raise root.find("distortion_model").error(f"{named!r} has no equal here; there are: {known}")
    name = root.first("camera_name")
    return StatedLens(
        camera,
        f"camera_info of ROS, {named or 'no distortion model'}, {size[0]} x {size[1]} px, the centre of the top-left "
        "pixel is (0, 0)",
        None if name is None else str(name.data),
    )


def _refuse_parts(root: Field, size: tuple[int, int]) -> None:
    """Check that the images are of the whole sensor.

    Raises:
        DatasetError: if they are binned or cropped.
    """
    for axis in ("binning_x", "binning_y"):
        if (binning := root.first(axis)) is not None and binning.integer(0) > 1:
            raise binning.error("the matrix is of the unbinned image, the images are not: give that of the images")
    if (part := root.first("roi")) is not None:
        sides = tuple(part.find(side).integer(0) for side in ("width", "height"))
        if all(sides) and sides != size:
            raise part.error("the matrix is of the whole image, the images are a part of it: give that of the images")
