"""Export of a ROS 2 launch file that publishes transforms on `/tf_static`."""

from __future__ import annotations

from basecal.exchange.exports.exporter import Exporter, Wanted, comments, describe_transform
from basecal.exchange.ros2 import publisher_arguments, static_transform_publisher


def export_text(request: Wanted) -> str:
    """Format a launch file with one node per transform, and the equivalent command in a comment."""
    nodes = []
    for one in request.transforms:
        mean = one.estimate.mean
        command = static_transform_publisher(mean, one.parent, one.child)
        nodes += [
            *comments([describe_transform(one, "m, quaternion x, y, z, w"), command], "#"),
            "Node(",
            '    package="tf2_ros",',
            '    executable="static_transform_publisher",',
            f"    name={one.name!r},",
            f"    arguments={publisher_arguments(mean, one.parent, one.child)!r},",
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
