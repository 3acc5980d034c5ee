"""AprilTags and ArUco markers: OpenCV reads them, each corner is then fitted in the image."""

from __future__ import annotations

from functools import cache
from typing import Any

import cv2
import numpy as np

from basecal.cell.target import Tags, Target
from basecal.geometry import Array, IntArray
from basecal.vision.detection import Detection, Image, eight_bit, found
from basecal.vision.fit.corners import Corners, Window, refined
from basecal.vision.fit.shapes import wedge
from basecal.vision.kinds.fiducial import dictionary

_CORNERS = 4


def detect(image: Image, target: Target) -> Detection | None:
    """The corners of a target's tags, or None.

    A tag seen twice in the image is left out.

    Args:
        image: (h, w), uint8 or uint16.
        target: One with `tags`.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits, or OpenCV does not know the family.
    """
    if target.tags is None:
        return None
    rows, start = _own(target.tags, *_read(image, target.tags))
    if not len(rows):
        return None
    ids = target.tags.corner_ids[rows].ravel()
    fitted = _corners(np.asarray(image), start, dictionary(target.tags.family).markerSize + 2 * target.tags.border)
    return found(ids[fitted.trusted], fitted.pixels[fitted.trusted], fitted.sigma_px[fitted.trusted])


def _read(image: Image, tags: Tags) -> tuple[IntArray, Array]:
    """Numbers of all tags in an image, (m,), and their corners, (m, 4, 2) [px]."""
    quads, numbers, _ = _detector(tags.family, tags.border).detectMarkers(eight_bit(image))
    if numbers is None:
        return np.zeros(0, dtype=np.int64), np.zeros((0, _CORNERS, 2))
    return numbers.ravel().astype(np.int64), np.reshape(quads, (-1, _CORNERS, 2)).astype(np.float64)


@cache
def _detector(family: str, border: int) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border
    return cv2.aruco.ArucoDetector(dictionary(family), parameters)


def _own(tags: Tags, numbers: IntArray, quads: Array) -> tuple[IntArray, Array]:
    """Which of a target's tags are seen once, (k,), and their corners, (k, 4, 2) [px]."""
    seen, first, count = np.unique(numbers, return_index=True, return_counts=True)
    _, rows, at = np.intersect1d(tags.numbers, seen[count == 1], return_indices=True)
    return rows, quads[first[count == 1][at]]


def _corners(image: Image, quads: Array, cells: int) -> Corners:
    """Corners of tags, (n * 4,): dark inside and bright outside for the width of a cell."""
    axes = cells * np.stack([_first_cells(quad, cells) for quad in quads]).reshape(-1, 2, 2)
    window = Window(arm_px=12.0, arm=0.5, inside=1 / cells, outside=np.inf, before=1 / cells)
    return refined(image, wedge, quads.reshape(-1, 2), axes, window)


def _first_cells(quad: Array, cells: int) -> Array:
    """What the first cell along each line of each corner is in the image, (4, 2, 2) [px], seen in perspective."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    image_from_square = cv2.getPerspectiveTransform(square, quad.astype(np.float32))
    lines = np.stack([np.roll(square, -1, axis=0) - square, np.roll(square, 1, axis=0) - square], axis=1)
    ends = (square[:, None] + lines / cells).reshape(1, -1, 2)
    return np.asarray(cv2.perspectiveTransform(ends, image_from_square)).reshape(4, 2, 2) - quad[:, None]
