"""Tests of robots and cameras of ROS 2: another process sends over DDS on this computer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.acquisition.driver import Camera, Moves, Place
from basecal.acquisition.drivers.ros2 import open_camera, open_robot
from basecal.cell import Cell, Robot
from basecal.errors import DatasetError, DriverError

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")
from shared.ros2_domain import CELL, DOMAIN
from shared.second_process import second_process


def said(joints):
    """Stamp encoded in the joints [s]."""
    return joints[:4] @ [1e8, 1e5, 100, 0.01]


def drawn(grey):
    """Stamp encoded in the pixels [s]."""
    return int.from_bytes(grey[0, :8].tobytes(), "big") * 1e-9


@pytest.mark.journey
def test_every_state_and_image_has_its_own_stamp(ros2_cell):
    """No state or image has the stamp of another, and stamps increase."""
    robot, camera = open_robot(ros2_cell.place("eye")), open_camera(ros2_cell.place("wrist", topic="/wrist/image_raw"))
    assert isinstance(camera, Camera)
    assert not isinstance(robot, Moves)
    pairs = [(robot.state(), camera.image()) for _ in range(20)]
    for reading, image in pairs:
        assert said(reading.state.joints_rad) == pytest.approx(reading.stamp_s, abs=1e-6)
        assert drawn(image.grey) == pytest.approx(image.stamp_s, abs=1e-6)
    for each in zip(*pairs, strict=True):
        assert np.all(np.diff([one.stamp_s for one in each]) > 0)


def test_robot_is_read_from_its_frames(ros2_cell):
    """The flange in the base follows from a moving and a static frame, at one stamp."""
    options = ros2_cell.place("eye", frames=["base_link", "tool0"]).options
    robot = open_robot(Place("arm", Cell("arm", {"arm": Robot("arm")}), Path("."), options))
    for _ in range(5):
        reading = robot.state()
        pose = reading.state.base_from_flange
        assert pose.translation[0] == pytest.approx(reading.stamp_s % 1 + 0.25, abs=1e-6)
        np.testing.assert_allclose(np.diag(pose.rotation), [-1, -1, 1], atol=1e-12)


@pytest.mark.journey
def test_missing_topics_are_reported_with_existing_ones(ros2_cell):
    """An unknown topic, one of another type, and unconnected frames are reported."""
    with pytest.raises(DriverError, match=r"eye: no publisher of /joints in domain \d+; there are: /joint_states, /r"):
        open_robot(ros2_cell.place("eye", topic="/joints", reconnect_s=2.0))
    with pytest.raises(DriverError, match="wrist: /tf is of tf2_msgs/msg/TFMessage, expected sensor_msgs/msg/Image"):
        open_camera(ros2_cell.place("wrist", topic="/tf"))
    with pytest.raises(DriverError, match=r"eye: no 'wrong'.*there are: base_link, link, tool0"):
        open_robot(ros2_cell.place("eye", frames=["base_link", "wrong"], reconnect_s=0.5)).state()


@pytest.mark.journey
def test_missing_joints_are_named(ros2_cell):
    """If the topic has only some joints of the URDF, the others are named."""
    ros2_cell.tell("partial", "on")
    with pytest.raises(
        DriverError, match=r"eye: /joint_states lacks joints of the URDF: wrist_1, wrist_2, wrist_3; it has elbow, g"
    ):
        open_robot(ros2_cell.place("eye", reconnect_s=0.2)).state()


@pytest.mark.journey
@pytest.mark.parametrize(
    ("fault", "error"),
    [
        ("freeze on", r"eye: stale stamps: \d+ messages came on /joint_states"),
        ("rate joints 0", "eye: no message came on /joint_states for 1.2 s, although it has a pub"),
        pytest.param(
            "rate joints 4",
            "eye: only [34].* states in a second came for 5.* s, at least 10 are needed",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_faults_of_topics_are_one_line(ros2_cell, fault, error):
    """Constant stamps, silence and a low rate cause one line."""
    robot = open_robot(ros2_cell.place("eye", reconnect_s=0.2))
    robot.state()
    ros2_cell.tell(*fault.split())
    with pytest.raises(DriverError, match=error) as raised:
        [robot.state() for _ in range(60)]
    assert "\n" not in str(raised.value)


def test_images_of_another_size_are_refused(ros2_cell):
    """If the cell states the size of images, others are not from this camera."""
    place = ros2_cell.place("wrist", topic="/wrist/image_raw")
    camera = open_camera(Place("wrist", CELL, Path("."), place.options))
    with pytest.raises(DriverError, match="wrist: an image of /wrist/image_raw has 64 x 48 pixels"):
        camera.image()


@pytest.mark.parametrize(
    ("open_it", "name", "options", "error"),
    [
        (open_robot, "eye", {"topic": "/a", "frames": ["b", "t"]}, r"robots\.eye\.driver: topic and frames are both"),
        (open_robot, "eye", {"domain": 300}, r"robots\.eye\.driver\.domain"),
        (open_robot, "eye", {"topic": "joint_states"}, r"robots\.eye\.driver\.topic"),
        (open_camera, "wrist", {}, r"cameras\.wrist\.driver: expected the topic of its images"),
    ],
)
def test_wrong_options_are_reported_with_their_field(tmp_path, open_it, name, options, error):
    """They are reported before any access to the network."""
    with pytest.raises(DatasetError, match=error):
        open_it(Place(name, CELL, tmp_path, {"domain": DOMAIN, **options}))


def test_joint_states_need_a_urdf(tmp_path):
    """For a robot without URDF, poses or frames can be read."""
    with pytest.raises(DatasetError, match=r"robots\.arm\.driver: joint states need urdf"):
        open_robot(Place("arm", Cell("arm", {"arm": Robot("arm")}), tmp_path, {"domain": DOMAIN}))


@pytest.mark.slow
def test_two_publishers_of_one_topic_are_refused(ros2_cell):
    """The error names both processes; when the second has ended, states continue."""
    robot = open_robot(ros2_cell.place("eye"))
    robot.state()
    with second_process("shared.ros2_publisher", ros2_cell.domain, 50, 0, 64, 48) as second:
        with pytest.raises(DriverError, match="eye: 2 publishers send /joint_states: ") as raised:
            [robot.state() for _ in range(200)]
        for process in (ros2_cell.process, second.process):
            assert f" {process.pid} on " in str(raised.value)
    robot = open_robot(ros2_cell.place("eye"))
    stamps = [robot.state().stamp_s for _ in range(100)]
    assert np.all(np.diff(stamps) > 0)
