"""Prints rendered into backdrops: images of the surroundings that another program rendered without distortion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.errors import InputError
from basecal.geometry import Array, Camera
from basecal.vision.draw.render import (
    Levels,
    RenderSettings,
    View,
    apply_point_spread,
    checked_size,
    paint_targets,
    supersample,
)

_LARGEST_WIDENING = 2.5  # size of the undistorted image relative to the lens's image; wider lenses are rejected
_BORDER_POINTS = 40  # pixels along each side of an image, from which the field of view is computed


@dataclass(frozen=True, eq=False)
class Backdrop:
    """An image in which the target is blank paper.

    Attributes:
        levels: Grey levels, (h, w), up to 255.
        paper: Share of each pixel that shows the target's paper, (h, w).
    """

    levels: Levels
    paper: Levels


@dataclass(frozen=True, eq=False)
class UndistortedCamera:
    """A camera without distortion that covers a lens's field of view, and the lens's pixels in its image.

    Attributes:
        focal_px: Focal length of both axes.
        size_px: Width and height; the principal point is in the middle.
        u: Column in the undistorted image for each pixel of the lens, (h, w).
        v: Row in the undistorted image for each pixel of the lens, (h, w).
    """

    focal_px: float
    size_px: tuple[int, int]
    u: Levels
    v: Levels

    def backdrop(self, colours: NDArray[np.uint8]) -> Backdrop:
        """Distort an image, (h, w, 3), which is grey except for the target's paper, which has no blue."""
        red, blue = (np.asarray(colours[..., channel], dtype=np.float32) for channel in (0, 2))
        paper = 1 - blue / np.maximum(red, 1)
        levels, share = (cv2.remap(each, self.u, self.v, cv2.INTER_LINEAR) for each in (red, paper * (red > 0)))
        return Backdrop(np.asarray(levels, dtype=np.float32), np.asarray(share, dtype=np.float32))


def undistorted_camera(lens: Camera) -> UndistortedCamera:
    """A camera without distortion that covers the field of view of a lens.

    Raises:
        InputError: if the lens has no image size, or its field of view is too wide.
    """
    width, height = checked_size(lens)
    focal = float(lens.focal.mean())
    across, down = np.linspace(0, width - 1, _BORDER_POINTS), np.linspace(0, height - 1, _BORDER_POINTS)
    sides = [(u, v) for u in across for v in (0, height - 1)] + [(u, v) for u in (0, width - 1) for v in down]
    plane, is_visible = _plane(lens, np.array(sides, dtype=np.float64))
    reach = 2 * np.ceil(focal * np.abs(plane).max(0)) + 2 if is_visible else np.full(2, np.inf)
    if not (reach[0] < _LARGEST_WIDENING * width and reach[1] < _LARGEST_WIDENING * height):
        raise InputError("the field of view of the lens is too wide to draw the surroundings")
    size = (int(reach[0]), int(reach[1]))
    v, u = np.mgrid[:height, :width].astype(np.float64)
    pixels = focal * _plane(lens, np.stack([u, v], -1))[0] + (np.array(size) - 1) / 2
    return UndistortedCamera(focal, size, pixels[..., 0].astype(np.float32), pixels[..., 1].astype(np.float32))


def _plane(lens: Camera, pixels: Array) -> tuple[Array, bool]:
    """Points on the plane z = 1 of pixels, (..., 2), and whether all pixels have rays with z > 0."""
    rays, valid = lens.undistort(pixels)
    with np.errstate(all="ignore"):
        return rays[..., :2] / rays[..., 2:], bool(valid.all() and (rays[..., 2] > 0).all())


def print_targets(camera: Camera, views: Sequence[View], backdrop: Backdrop, settings: RenderSettings) -> Array:
    """Radiance on the sensor before noise and rounding, (h, w): the backdrop with targets printed on its paper.

    Raises:
        InputError: if the camera has no size, or a target is not printed.
    """
    width, height = size_px = checked_size(camera)
    share = np.ones((height, width), dtype=np.float32)
    ink = replace(settings, white=1.0, black=settings.black / settings.white)
    printed = paint_targets(supersample(share), camera, views, ink)
    levels, paper = supersample(backdrop.levels), supersample(backdrop.paper)
    return apply_point_spread(levels * (1 - paper * (1 - printed)), settings, size_px)
