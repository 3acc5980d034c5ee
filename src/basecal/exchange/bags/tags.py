"""AprilTags that detectors of ROS found while a bag was recorded: corners, or poses alone.

Messages of `apriltag_msgs` have corners. The detector counts pixels from the corner of the first one, half a pixel from
its centre. It goes counter-clockwise round a tag from the lower left. Its lower left is top right for OpenCV, whose
images of tags are turned by half a turn.
Messages of `apriltag_ros` in ROS 1, before that of `apriltags2_ros`, have the pose of each tag in the camera of the
rectified image. It is by the tag's size that their settings had. A tag's frame has x to its right, y up and z out of
it, as AprilTag prints it. This is half a turn from how OpenCV draws it.

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
"""Of messages by type, as the library of bags takes them."""

_PLACES = (1, 0, 3, 2)  # among the detector's corners, of those clockwise from OpenCV's top left
_HALF_PX = 0.5  # from the corner of the first pixel to its centre

_CORNERS_IN_TAG = np.array([[1, -1, 0], [-1, -1, 0], [-1, 1, 0], [1, 1, 0]])  # clockwise as OpenCV draws them
_ONLY_TAG = -1.0  # the number of the only tag of an image, where a target has none by name


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


@dataclass(frozen=True, eq=False)
class TagFrames:
    """How a target stands in the frames of its tags.

    Attributes:
        tag_from_target: By the number of a tag. Without any, the only detection of an image is the target.
    """

    tag_from_target: Mapping[int, SE3]

    def nearest_tag(self, message: Any) -> Array | None:
        """Place and quaternion of a tag in the camera, and its number, (8,); of several the nearest. None for none."""
        found = [each for each in message.detections if len(each.id) == 1 and int(each.id[0]) in self.tag_from_target]
        if not self.tag_from_target and len(message.detections) == 1:
            found = list(message.detections)
        values = []
        for each in found:
            number = float(each.id[0]) if self.tag_from_target else _ONLY_TAG
            values.append(np.append(pose_values(each.pose.pose.pose), number))
        return min(values, key=lambda each: float(np.sum(each[:3] ** 2)), default=None)

    def target_poses(self, camera_from_tag: SE3, numbers: Array) -> SE3:
        """Poses of the target, (n,), where those of tags, (n,), of these numbers, (n,), were seen."""
        if not self.tag_from_target:
            return camera_from_tag
        return camera_from_tag @ SE3.stack([self.tag_from_target[int(number)] for number in numbers])


def frames_of_tags(target: Target | None) -> TagFrames:
    """The frames of a target's tags, by their corners; none of a target that is seen as a pose alone."""
    if target is None or target.tags is None:
        return TagFrames({})
    corners = target.points[target.rows(target.tags.corner_ids.ravel())].reshape(-1, 4, 3)
    frames = {}
    for number, corners_in_target in zip(target.tags.numbers, corners, strict=True):
        centre = corners_in_target.mean(0)
        rotation = nearest_rotation((corners_in_target - centre).T @ _CORNERS_IN_TAG)
        frames[int(number)] = SE3(rotation, centre).inverse()
    return TagFrames(frames)
