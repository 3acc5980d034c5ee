"""A transform as ROS 2 says it: `parent_from_child`, metres, quaternion (x, y, z, w)."""

from __future__ import annotations

from shlex import quote

from basecal.geometry import SE3


def static_transform_publisher(parent_from_child: SE3, frame_id: str, child_frame_id: str) -> str:
    """The command that publishes a transform on `/tf_static`, names quoted for a shell.

    Args:
        parent_from_child: The transform.
        frame_id: Name of the parent's frame.
        child_frame_id: Name of the child's frame.
    """
    values = [*parent_from_child.translation, *parent_from_child.quaternion]
    flags = ("x", "y", "z", "qx", "qy", "qz", "qw")
    pose = " ".join(f"--{flag} {round(float(value), 9) + 0.0:.9f}" for flag, value in zip(flags, values, strict=True))
    frames = f"--frame-id {quote(frame_id)} --child-frame-id {quote(child_frame_id)}"
    return f"ros2 run tf2_ros static_transform_publisher {pose} {frames}"
