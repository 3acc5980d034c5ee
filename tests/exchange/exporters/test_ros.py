"""Tests of the export of ROS messages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

from basecal.errors import InputError
from basecal.exchange.exporters.ros import export_text
from basecal.exchange.ros2 import ros_covariance
from basecal.geometry import SE3
from export_example import BASE, INVERSE, all_poses, wanted

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types


def message_of(text):
    """Return the text as a message of ROS 2 types, through its serialisation."""
    fields = YAML(typ="safe", pure=True).load(text)
    pose = fields["pose"]["pose"]
    header = TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](0, 0), fields["header"]["frame_id"])
    placed = TYPES["geometry_msgs/msg/Pose"](
        TYPES["geometry_msgs/msg/Point"](**pose["position"]),
        TYPES["geometry_msgs/msg/Quaternion"](**pose["orientation"]),
    )
    covariance = np.array(fields["pose"]["covariance"])
    known = TYPES["geometry_msgs/msg/PoseWithCovariance"](placed, covariance)
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    return STORE.deserialize_cdr(STORE.serialize_cdr(TYPES[kind](header, known), kind), kind)


@pytest.mark.parametrize("name", all_poses())
def test_ros_types_accept_exported_pose(name):
    """The message holds the pose and its covariance, by rows in the parent's frame, to 1e-12."""
    (one,) = wanted(name).transforms
    read = message_of(export_text(wanted(name)))
    place, turn = read.pose.pose.position, read.pose.pose.orientation
    again = SE3.from_quaternion([turn.x, turn.y, turn.z, turn.w], [place.x, place.y, place.z])
    np.testing.assert_allclose(again.matrix, one.estimate.mean.matrix, atol=1e-12)
    np.testing.assert_allclose(read.pose.covariance.reshape(6, 6), ros_covariance(one.estimate), atol=1e-18)
    assert read.header.frame_id == one.parent
    assert f"# child frame: {one.child}\n" in export_text(wanted(name))


def test_message_holds_one_pose():
    """The error requests a choice if there are several transforms."""
    both = replace(wanted(), transforms=(*wanted(BASE).transforms, *wanted(INVERSE).transforms))
    with pytest.raises(InputError, match=f"with --transform: {BASE}, {INVERSE}"):
        export_text(both)


def test_negative_zeros_are_not_written() -> None:
    """Zeros of position and orientation are written without sign."""
    request = wanted(BASE)
    (one,) = request.transforms
    zeros = SE3(np.diag([-1.0, -1.0, 1.0]), np.array([-0.0, 0.0, -0.0]))
    text = export_text(replace(request, transforms=(replace(one, estimate=replace(one.estimate, mean=zeros)),)))
    lines = [line for line in text.splitlines() if "position" in line or "orientation" in line]
    assert len(lines) == 2
    assert "-0.0" not in "".join(lines)
