"""Lenses as ROS calls them, `distortion_model` of `sensor_msgs/CameraInfo`, in both directions.

Source: sensor_msgs/distortion_models.hpp and CameraInfo.msg: plumb_bob has (k1, k2, t1, t2, k3), rational_polynomial
(k1, k2, t1, t2, k3, k4, k5, k6), equidistant (k1, k2, k3, k4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.errors import InputError
from basecal.geometry import Array, Camera
from basecal.geometry.lenses import fisheye, pinhole


class RosLens(NamedTuple):
    """A lens of ROS: its name there, our model, and how many terms it has."""

    name: str
    model: str
    terms: int


ROS_LENSES = (
    RosLens("plumb_bob", pinhole.MODEL, 5),
    RosLens("rational_polynomial", pinhole.MODEL, 8),
    RosLens("equidistant", fisheye.MODEL, 4),
)


def ros_lens(camera: Camera) -> tuple[str, Array]:
    """Name and distortion terms of a lens in ROS, terms that ours leaves out being zero.

    Raises:
        InputError: if ROS has no such lens.
    """
    count = len(camera.distortion)
    for lens in ROS_LENSES:
        if lens.model == camera.model and count <= lens.terms:
            return lens.name, np.concatenate([camera.distortion, np.zeros(lens.terms - count)])
    names = ", ".join(lens.name for lens in ROS_LENSES)
    raise InputError(f"ROS has no name for a {camera.model} lens with {count} distortion terms; it has {names}")
