"""Transforms and covariances in ROS 2: `parent_from_child`, metres, quaternion (x, y, z, w)."""

from __future__ import annotations

from shlex import quote

import numpy as np

from basecal.geometry import SE3, Array, PoseEstimate

_FLAGS = ("x", "y", "z", "qx", "qy", "qz", "qw")


def publisher_arguments(parent_from_child: SE3, frame_id: str, child_frame_id: str) -> list[str]:
    """Arguments of tf2_ros's `static_transform_publisher` for a transform.

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
    """Shell command that publishes a transform on `/tf_static`; see `publisher_arguments`."""
    words = publisher_arguments(parent_from_child, frame_id, child_frame_id)
    return " ".join(["ros2 run tf2_ros static_transform_publisher", *map(quote, words)])


def ros_covariance(parent_from_child: PoseEstimate) -> Array:
    """Convert a covariance to the convention of `geometry_msgs/PoseWithCovariance`, (6, 6) [m, rad].

    Our covariance is in the axes of the child. The covariance of ROS is of x, y, z of the child's origin in the
    parent, then of small rotations. Their axes pass through that origin and are parallel to the parent's axes. Both
    halves are therefore rotated, without a lever arm.

    Source: geometry_msgs/PoseWithCovariance.msg, "fixed-axis representation".
    """
    turn = np.kron(np.eye(2), parent_from_child.mean.rotation)
    covariance: Array = turn @ parent_from_child.covariance @ turn.T
    return covariance
