"""A transform as ROS 2 says it: `parent_from_child`, metres, quaternion (x, y, z, w)."""

from __future__ import annotations

from shlex import quote

from basecal.geometry import SE3

_FLAGS = ("x", "y", "z", "qx", "qy", "qz", "qw")


def publisher_arguments(parent_from_child: SE3, frame_id: str, child_frame_id: str) -> list[str]:
    """What tf2_ros's `static_transform_publisher` is given to publish a transform.

    Args:
        parent_from_child: The transform.
        frame_id: Name of the parent's frame.
        child_frame_id: Name of the child's frame.
    """
    values = [*parent_from_child.translation, *parent_from_child.quaternion]
    pose = [(f"--{flag}", f"{round(float(value), 9) + 0.0:.9f}") for flag, value in zip(_FLAGS, values, strict=True)]
    frames = [("--frame-id", frame_id), ("--child-frame-id", child_frame_id)]
    return [word for pair in (*pose, *frames) for word in pair]


def static_transform_publisher(parent_from_child: SE3, frame_id: str, child_frame_id: str) -> str:
    """The command that publishes a transform on `/tf_static`, names quoted for a shell; likewise."""
    words = publisher_arguments(parent_from_child, frame_id, child_frame_id)
    return " ".join(["ros2 run tf2_ros static_transform_publisher", *map(quote, words)])
