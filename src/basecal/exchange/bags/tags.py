"""Corners of AprilTags that a detector found while a bag was recorded: `apriltag_msgs/AprilTagDetectionArray`.

The detector counts pixels from the corner of the first one, half a pixel from its centre. It goes counter-clockwise
round a tag from the lower left. Its lower left is top right for OpenCV, whose images of tags are turned by half a
turn.

Source: apriltag_msgs/msg/AprilTagDetection.msg; apriltag.h of AprilTag 3, `apriltag_detection`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from basecal.cell.target import Tags
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import Array, IntArray

TAGS = "apriltag_msgs/msg/AprilTagDetectionArray"
DEFINITIONS = {
    "apriltag_msgs/msg/Point": "float64 x\nfloat64 y",
    "apriltag_msgs/msg/AprilTagDetection": (
        "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n"
        "apriltag_msgs/Point centre\napriltag_msgs/Point[4] corners\nfloat64[9] homography"
    ),
    TAGS: "std_msgs/Header header\napriltag_msgs/AprilTagDetection[] detections",
}
"""Of messages by type, as the library of bags takes them."""

_PLACES = (1, 0, 3, 2)  # among the detector's corners, of those clockwise from OpenCV's top left
_HALF_PX = 0.5  # from the corner of the first pixel to its centre


class SeenTags(NamedTuple):
    """Corners of one image.

    Attributes:
        ids: (n,) of the points of the target.
        pixels: (n, 2), the centre of the top-left pixel is (0, 0).
    """

    ids: IntArray
    pixels: Array


def tag_corners(message: Any, tags: Tags) -> SeenTags | None:
    """The corners of a target's tags in a message; None if it has none of them, one twice, or no numbers."""
    rows = {int(number): row for number, row in zip(tags.numbers, tags.corner_ids, strict=True)}
    found = [each for each in message.detections if each.id in rows and tags.family.endswith(each.family)]
    if not found or len({each.id for each in found}) < len(found):
        return None
    pixels = [[(each.corners[k].x, each.corners[k].y) for k in _PLACES] for each in found]
    corners = np.array(pixels, dtype=np.float64).reshape(-1, 2) - _HALF_PX
    ids = np.concatenate([rows[each.id] for each in found])
    return SeenTags(ids, corners) if np.all(np.abs(corners) <= LARGEST_VALUE) else None
