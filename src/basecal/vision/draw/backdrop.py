"""Prints drawn into images of what stands around them, which another program drew without a lens."""

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

_LARGEST_WIDENING = 2.5  # of an image without distortion: beyond, a lens is too wide for it
_BORDER_POINTS = 40  # pixels along each side of an image, that tell how far a lens sees


@dataclass(frozen=True, eq=False)
class Backdrop:
    """An image without what is printed on the target.

    Attributes:
        levels: (h, w), of 255.
        paper: (h, w), the share of each pixel that shows paper of the target.
    """

    levels: Levels
    paper: Levels


@dataclass(frozen=True, eq=False)
class Flat:
    """A camera without distortion that sees all that a lens sees, and where each of the lens's pixels is in it.

    Attributes:
        focal_px: Of both axes.
        size_px: Width and height; the camera's axis goes through the middle.
        u: (h, w) by pixels of the lens.
        v: Likewise.
    """

    focal_px: float
    size_px: tuple[int, int]
    u: Levels
    v: Levels

    def backdrop(self, colours: NDArray[np.uint8]) -> Backdrop:
        """The image (h, w, 3) as the lens images it, grey but for paper, which has no blue."""
        red, blue = (np.asarray(colours[..., channel], dtype=np.float32) for channel in (0, 2))
        paper = 1 - blue / np.maximum(red, 1)
        levels, share = (cv2.remap(each, self.u, self.v, cv2.INTER_LINEAR) for each in (red, paper * (red > 0)))
        return Backdrop(np.asarray(levels, dtype=np.float32), np.asarray(share, dtype=np.float32))


def undistorted_camera(lens: Camera) -> Flat:
    """A camera without distortion for a lens.

    Raises:
        InputError: if the lens has no size, or sees too far to the sides.
    """
    width, height = checked_size(lens)
    focal = float(lens.focal.mean())
    across, down = np.linspace(0, width - 1, _BORDER_POINTS), np.linspace(0, height - 1, _BORDER_POINTS)
    sides = [(u, v) for u in across for v in (0, height - 1)] + [(u, v) for u in (0, width - 1) for v in down]
    plane, seen = _plane(lens, np.array(sides, dtype=np.float64))
    reach = 2 * np.ceil(focal * np.abs(plane).max(0)) + 2 if seen else np.full(2, np.inf)
    if not (reach[0] < _LARGEST_WIDENING * width and reach[1] < _LARGEST_WIDENING * height):
        raise InputError("the lens sees too far to the sides to be drawn with what stands around")
    size = (int(reach[0]), int(reach[1]))
    v, u = np.mgrid[:height, :width].astype(np.float64)
    at = focal * _plane(lens, np.stack([u, v], -1))[0] + (np.array(size) - 1) / 2
    return Flat(focal, size, at[..., 0].astype(np.float32), at[..., 1].astype(np.float32))


def _plane(lens: Camera, pixels: Array) -> tuple[Array, bool]:
    """Where pixels (..., 2) look on the plane one metre ahead, and whether all look ahead."""
    rays, valid = lens.undistort(pixels)
    with np.errstate(all="ignore"):
        return rays[..., :2] / rays[..., 2:], bool(valid.all() and (rays[..., 2] > 0).all())


def print_targets(camera: Camera, views: Sequence[View], backdrop: Backdrop, settings: RenderSettings) -> Array:
    """Radiance on the sensor before noise and rounding, (h, w): the backdrop, its paper printed with targets.

    Raises:
        InputError: if the camera has no size, or a target is not printed.
    """
    width, height = size_px = checked_size(camera)
    share = np.ones((height, width), dtype=np.float32)
    ink = replace(settings, white=1.0, black=settings.black / settings.white)
    printed = paint_targets(supersample(share), camera, views, ink)
    levels, paper = supersample(backdrop.levels), supersample(backdrop.paper)
    return apply_point_spread(levels * (1 - paper * (1 - printed)), settings, size_px)
