"""AprilTags and ArUco markers: OpenCV reads them, each corner is then fitted in the image.

Corners go round clockwise from the top left of the tag as OpenCV draws it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import cv2
import numpy as np

from basecal.cell.target import Target
from basecal.geometry import Array, IntArray
from basecal.vision.detection import Detection, Image, eight_bit, found
from basecal.vision.fit.corners import Corners, Window, refined
from basecal.vision.fit.shapes import wedge
from basecal.vision.kinds.fiducial import dictionary

_CORNERS = 4


def detect(image: Image, target: Target) -> Detection | None:
    """The corners of a target's tags, by ids 4 * tag + corner, or None.

    A tag seen twice in the image is left out.

    Args:
        image: (h, w), uint8 or uint16.
        target: The tags.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits, or OpenCV does not know the family.
    """
    family = target.options["family"]
    quads, tags, _ = _detector(family).detectMarkers(eight_bit(image))
    if tags is None or not len(tags):
        return None
    tags, start = _own(target, tags.ravel().astype(np.int64), np.reshape(quads, (-1, _CORNERS, 2)).astype(np.float64))
    if not len(tags):
        return None
    fitted = _corners(np.asarray(image), start, cells=dictionary(family).markerSize + 2)
    ids = (_CORNERS * tags[:, None] + np.arange(_CORNERS)).ravel()
    return found(ids[fitted.trusted], fitted.pixels[fitted.trusted], fitted.sigma_px[fitted.trusted])


@cache
def _detector(family: str) -> Any:
    return cv2.aruco.ArucoDetector(dictionary(family))


def _own(target: Target, tags: IntArray, quads: Array) -> tuple[IntArray, Array]:
    """The tags that are on the target, each seen once."""
    wanted = [number for number, _, _ in target.options["tags"]]
    numbers, first, count = np.unique(tags, return_index=True, return_counts=True)
    kept = first[(count == 1) & np.isin(numbers, wanted)]
    return tags[kept], quads[kept]


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
