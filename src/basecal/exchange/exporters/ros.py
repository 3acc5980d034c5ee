"""Export of a pose with covariance as a ROS message in YAML: `geometry_msgs/PoseWithCovarianceStamped`."""

from __future__ import annotations

import json

from basecal.errors import InputError
from basecal.exchange.exports.exporter import Exporter, ExportRequest, comments, describe_transform, yaml_word
from basecal.exchange.ros2 import ros_covariance


def export_text(request: ExportRequest) -> str:
    """Format a message for `ros2 topic pub`; a comment names the child frame, for which the message has no field.

    Raises:
        InputError: if several transforms are requested.
    """
    if len(request.transforms) != 1:
        names = ", ".join(transform.name for transform in request.transforms)
        raise InputError(f"a message holds one pose: choose one with --transform: {names}")
    (transform,) = request.transforms
    mean = transform.estimate.mean
    position = {key: value + 0.0 for key, value in zip("xyz", mean.translation.tolist(), strict=True)}
    orientation = {key: value + 0.0 for key, value in zip("xyzw", mean.quaternion.tolist(), strict=True)}
    axes = "covariance: x, y, z, then rotations, along and about the fixed axes of the frame in the header"
    return "\n".join(
        [
            *comments(
                [
                    *request.remarks,
                    describe_transform(transform, "m, quaternion x, y, z, w"),
                    f"child frame: {transform.child}",
                ],
                "#",
            ),
            *comments([axes], "#"),
            "header:",
            f"  frame_id: {yaml_word(transform.parent)}",
            "pose:",
            "  pose:",
            f"    position: {json.dumps(position)}",
            f"    orientation: {json.dumps(orientation)}",
            f"  covariance: {json.dumps(ros_covariance(transform.estimate).ravel().tolist())}",
            "",
        ]
    )


EXPORTER = Exporter("geometry_msgs/PoseWithCovarianceStamped as YAML", export_text, is_pasted=True)
