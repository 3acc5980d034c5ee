"""Types of ROS 2's messages."""

from __future__ import annotations

import pytest

from basecal.acquisition.ros2.types import dds_name, fields_of, kind_of_dds, members, type_hash
from basecal.errors import InputError

pytest.importorskip("ros2_pyterfaces")
KINDS = [
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/CameraInfo",
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/msg/String",
]


@pytest.mark.parametrize("kind", KINDS)
def test_hashes_and_fields_are_those_of_rosbags(kind):
    """Another program that knows ROS 2's definitions has the same hash and the same names of fields."""
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    assert type_hash(kind) == store.hash_rihs01(kind)
    assert (
        list(members(fields_of(kind))) == list(store.types[kind].__dataclass_fields__)[: len(members(fields_of(kind)))]
    )


def test_names_on_the_wire():
    """They go there and back; names of what is no message of ROS 2 are none."""
    assert dds_name("sensor_msgs/msg/JointState") == "sensor_msgs::msg::dds_::JointState_"
    assert [kind_of_dds(dds_name(kind)) for kind in KINDS] == KINDS
    assert kind_of_dds("std_srvs::srv::dds_::Empty_Request_") is None
    assert kind_of_dds("HelloWorld") is None


@pytest.mark.parametrize("kind", ["sensor_msgs/msg/Nothing", "no_such_msgs/msg/Image", "Image"])
def test_types_that_are_not_known(kind):
    """They are told by their name."""
    with pytest.raises(InputError, match="no definition of the message"):
        fields_of(kind)
