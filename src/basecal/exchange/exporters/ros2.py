"""Export of a ROS 2 launch file that publishes transforms on `/tf_static`."""

from __future__ import annotations

from basecal.exchange.exports.exporter import Exporter, ExportRequest, comments, describe_transform
from basecal.exchange.ros2 import publisher_arguments, static_transform_publisher


def export_text(request: ExportRequest) -> str:
    """Format a launch file with one node per transform, and the equivalent command in a comment."""
    nodes = []
    for transform in request.transforms:
        mean = transform.estimate.mean
        command = static_transform_publisher(mean, transform.parent, transform.child)
        nodes += [
            *comments([describe_transform(transform, "m, quaternion x, y, z, w"), command], "#"),
            "Node(",
            '    package="tf2_ros",',
            '    executable="static_transform_publisher",',
            f"    name={transform.name!r},",
            f"    arguments={publisher_arguments(mean, transform.parent, transform.child)!r},",
            "),",
        ]
    return "\n".join(
        [
            *comments(request.remarks, "#"),
            "from launch import LaunchDescription",
            "from launch_ros.actions import Node",
            "",
            "",
            "def generate_launch_description():",
            "    return LaunchDescription([",
            *(f"        {line}" for line in nodes),
            "    ])",
            "",
        ]
    )


EXPORTER = Exporter("launch file that publishes on /tf_static", export_text, is_pasted=True)
