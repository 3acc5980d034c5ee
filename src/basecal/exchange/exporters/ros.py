"""Export of a pose with covariance as a ROS message in YAML: `geometry_msgs/PoseWithCovarianceStamped`."""

from __future__ import annotations

import json

from basecal.errors import InputError
from basecal.exchange.exports.exporter import Exporter, Wanted, comments, describe_transform, yaml_word
from basecal.exchange.ros2 import ros_covariance


def export_text(request: Wanted) -> str:
    """Format a message for `ros2 topic pub`; a comment names the child frame, for which the message has no field.

    Raises:
        InputError: if several transforms are requested.
    """
    if len(request.transforms) != 1:
        names = ", ".join(one.name for one in request.transforms)
        raise InputError(f"a message holds one pose: choose one with --transform: {names}")
    (one,) = request.transforms
    place, turn = one.estimate.mean.translation.tolist(), one.estimate.mean.quaternion.tolist()
    position = {key: value + 0.0 for key, value in zip("xyz", place, strict=True)}
    orientation = {key: value + 0.0 for key, value in zip("xyzw", turn, strict=True)}
    axes = "covariance: x, y, z, then rotations, along and about the fixed axes of the frame in the header"
    return "\n".join(
        [
            *comments(
                [*request.remarks, describe_transform(one, "m, quaternion x, y, z, w"), f"child frame: {one.child}"],
                "#",
            ),
            *comments([axes], "#"),
            "header:",
            f"  frame_id: {yaml_word(one.parent)}",
            "pose:",
            "  pose:",
            f"    position: {json.dumps(position)}",
            f"    orientation: {json.dumps(orientation)}",
            f"  covariance: {json.dumps(ros_covariance(one.estimate).ravel().tolist())}",
            "",
        ]
    )


EXPORTER = Exporter("geometry_msgs/PoseWithCovarianceStamped as YAML", export_text, is_pasted=True)
