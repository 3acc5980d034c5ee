"""The lens of a `sensor_msgs/CameraInfo` of a bag."""

from __future__ import annotations

from typing import Any

import numpy as np

from basecal.exchange.fields import Field
from basecal.exchange.lens_files.camera_info import camera_info_lens
from basecal.exchange.lens_files.stated_lens import StatedLens

_RECTIFIED = "image_rect"


def bag_lens(info: Any, place: str, topic: str) -> StatedLens | None:
    """The lens of a camera's images; None if it was never calibrated.

    Images that ROS has rectified have the lens of the matrix P, and no distortion.

    Args:
        info: The message, of ROS 1 or ROS 2.
        place: The bag and the topic of the message, for an error.
        topic: Of the images.

    Raises:
        DatasetError: if it is no lens that has an equal here.
    """
    # ROS 1 writes the names of these fields large, and ROS 2 small.
    matrix, terms, projection = (
        [float(value) for value in (getattr(info, name) if hasattr(info, name) else getattr(info, name.upper()))]
        for name in "kdp"
    )
    if not any(matrix):
        return None
    kind = str(info.distortion_model)
    if topic.rpartition("/")[2].startswith(_RECTIFIED) or f"/{_RECTIFIED}" in topic:
        matrix, terms, kind = list(np.reshape(projection, (3, 4))[:, :3].ravel()), [], ""
    data = {
        "width": int(info.width),
        "height": int(info.height),
        "k": [float(value) for value in matrix],
        "d": terms,
        "distortion_model": kind,
        "binning_x": int(info.binning_x),
        "binning_y": int(info.binning_y),
        "roi": {side: int(getattr(info.roi, side)) for side in ("width", "height")},
    }
    return camera_info_lens(Field(place, data, {}))
