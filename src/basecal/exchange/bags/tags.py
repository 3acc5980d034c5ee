"""AprilTag detections in a bag: corners, or only poses.

Messages of `apriltag_msgs` have corners. The detector's pixel origin is the corner of the first pixel, which is half a
pixel from its centre. Corners are ordered counter-clockwise from the lower left of the tag. The lower left is OpenCV's
top right, because OpenCV draws tags rotated by 180 deg.
Messages of `apriltag_ros` in ROS 1, earlier `apriltags2_ros`, have the pose of each tag in the rectified camera. The
pose is computed with the tag size in the detector's settings. A tag's frame has x to the right, y up and z out of the
printed tag. It is rotated by 180 deg from OpenCV's drawing.

Source: apriltag_msgs/msg/AprilTagDetection.msg; apriltag.h of AprilTag 3, `apriltag_detection`;
apriltag_ros/msg/AprilTagDetection.msg; apriltag_ros/src/common_functions.cpp, `detectTags`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from basecal.cell.target import Tags, Target
from basecal.exchange.bags.frames import pose_values
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.rotation import nearest_rotation

PACKAGES = ("apriltag_ros", "apriltags2_ros")
TAG_POSES = tuple(f"{package}/msg/AprilTagDetectionArray" for package in PACKAGES)
TAGS = "apriltag_msgs/msg/AprilTagDetectionArray"
DEFINITIONS = {
    "apriltag_msgs/msg/Point": "float64 x\nfloat64 y",
    "apriltag_msgs/msg/AprilTagDetection": (
        "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n"
        "apriltag_msgs/Point centre\napriltag_msgs/Point[4] corners\nfloat64[9] homography"
    ),
    TAGS: "std_msgs/Header header\napriltag_msgs/AprilTagDetection[] detections",
    **{
        f"{package}/msg/AprilTagDetection{more}": text.format(package=package)
        for package in PACKAGES
        for more, text in (
            ("", "int32[] id\nfloat64[] size\ngeometry_msgs/PoseWithCovarianceStamped pose"),
            ("Array", "std_msgs/Header header\n{package}/AprilTagDetection[] detections"),
        )
    },
}
"""Message definitions by type, in the format of the library for bags."""

_CORNER_ORDER = (1, 0, 3, 2)  # indices of the detector's corners, clockwise from OpenCV's top left
_HALF_PX = 0.5  # from the corner of the first pixel to its centre

_CORNERS_IN_TAG = np.array([[1, -1, 0], [-1, -1, 0], [-1, 1, 0], [1, 1, 0]])  # clockwise as OpenCV draws them
_ONLY_TAG = -1.0  # number of the only tag of an image, for a target without numbered tags


class SeenTags(NamedTuple):
    """Detected tag corners of one image.

    Attributes:
        ids: (n,) ids of the target's points.
        pixels: (n, 2) [px], the centre of the top-left pixel is (0, 0).
    """

    ids: IntArray
    pixels: Array


def tag_corners(message: Any, tags: Tags) -> SeenTags | None:
    """Corners of a target's tags in a message; None if there are no tags, a tag twice, or invalid numbers."""
    rows = {int(number): row for number, row in zip(tags.numbers, tags.corner_ids, strict=True)}
    found = [each for each in message.detections if each.id in rows and tags.family.endswith(each.family)]
    if not found or len({each.id for each in found}) < len(found):
        return None
    pixels = [[(each.corners[k].x, each.corners[k].y) for k in _CORNER_ORDER] for each in found]
    corners = np.array(pixels, dtype=np.float64).reshape(-1, 2) - _HALF_PX
    ids = np.concatenate([rows[each.id] for each in found])
    return SeenTags(ids, corners) if np.all(np.abs(corners) <= LARGEST_VALUE) else None


@dataclass(frozen=True, eq=False)
class TagFrames:
    """Poses of a target in the frames of its tags.

    Attributes:
        tag_from_target: Poses by tag number. If empty, the only detection of an image is the target.
    """

    tag_from_target: Mapping[int, SE3]

    def nearest_tag(self, message: Any) -> Array | None:
        """Return position, quaternion and number of the tag nearest to the camera, (8,); None if there is no tag."""
        found = [each for each in message.detections if len(each.id) == 1 and int(each.id[0]) in self.tag_from_target]
        if not self.tag_from_target and len(message.detections) == 1:
            found = list(message.detections)
        values = []
        for each in found:
            number = float(each.id[0]) if self.tag_from_target else _ONLY_TAG
            values.append(np.append(pose_values(each.pose.pose.pose), number))
        return min(values, key=lambda each: float(np.sum(each[:3] ** 2)), default=None)

    def target_poses(self, camera_from_tag: SE3, numbers: Array) -> SE3:
        """Return poses of the target, (n,), from poses of tags, (n,), and the tags' numbers, (n,)."""
        if not self.tag_from_target:
            return camera_from_tag
        return camera_from_tag @ SE3.stack([self.tag_from_target[int(number)] for number in numbers])


def frames_of_tags(target: Target | None) -> TagFrames:
    """Compute the frames of a target's tags from their corners; empty for a target without tags."""
    if target is None or target.tags is None:
        return TagFrames({})
    corners = target.points[target.rows(target.tags.corner_ids.ravel())].reshape(-1, 4, 3)
    frames = {}
    for number, corners_in_target in zip(target.tags.numbers, corners, strict=True):
        centre = corners_in_target.mean(0)
        rotation = nearest_rotation((corners_in_target - centre).T @ _CORNERS_IN_TAG)
        frames[int(number)] = SE3(rotation, centre).inverse()
    return TagFrames(frames)
