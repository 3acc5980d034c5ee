"""Robots and cameras of ROS 2: a process of its own sends what their drivers send, over DDS on this computer."""

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
    """The stamp that joints say [s]."""
    return joints[:4] @ [1e8, 1e5, 100, 0.01]


def drawn(grey):
    """The stamp that pixels say [s]."""
    return int.from_bytes(grey[0, :8].tobytes(), "big") * 1e-9


def test_every_state_and_image_has_its_own_stamp(ros2_cell):
    """Of states and images taken as they come none stands at the stamp of another, and stamps rise."""
    robot, camera = open_robot(ros2_cell.place("eye")), open_camera(ros2_cell.place("wrist", topic="/wrist/image_raw"))
    assert isinstance(camera, Camera)
    assert not isinstance(robot, Moves)
    pairs = [(robot.state(), camera.image()) for _ in range(20)]
    for reading, image in pairs:
        assert said(reading.state.joints_rad) == pytest.approx(reading.stamp_s, abs=1e-6)
        assert drawn(image.grey) == pytest.approx(image.stamp_s, abs=1e-6)
    for each in zip(*pairs, strict=True):
        assert np.all(np.diff([one.stamp_s for one in each]) > 0)


def test_a_robot_by_its_frames(ros2_cell):
    """The flange in the base is the way over a frame that moves and one that does not, at one stamp."""
    options = ros2_cell.place("eye", frames=["base_link", "tool0"]).options
    robot = open_robot(Place("arm", Cell("arm", {"arm": Robot("arm")}), Path("."), options))
    for _ in range(5):
        reading = robot.state()
        pose = reading.state.base_from_flange
        assert pose.translation[0] == pytest.approx(reading.stamp_s % 1 + 0.25, abs=1e-6)
        np.testing.assert_allclose(np.diag(pose.rotation), [-1, -1, 1], atol=1e-12)


def test_what_is_not_sent_is_told_with_what_is(ros2_cell):
    """A topic that nobody sends, one of another type, frames that nothing joins."""
    with pytest.raises(DriverError, match=r"eye: no publisher of /joints in domain \d+; there are: /joint_states, /r"):
        open_robot(ros2_cell.place("eye", topic="/joints", reconnect_s=2.0))
    with pytest.raises(DriverError, match="wrist: /tf is of tf2_msgs/msg/TFMessage, expected sensor_msgs/msg/Image"):
        open_camera(ros2_cell.place("wrist", topic="/tf"))
    with pytest.raises(DriverError, match=r"eye: no 'wrong'.*there are: base_link, link, tool0"):
        open_robot(ros2_cell.place("eye", frames=["base_link", "wrong"], reconnect_s=0.5)).state()


def test_joints_that_are_missing_are_named(ros2_cell):
    """Where the topic has only some joints of the URDF, it says which are missing."""
    ros2_cell.tell("partial", "on")
    with pytest.raises(
        DriverError, match=r"eye: /joint_states lacks joints of the URDF: wrist_1, wrist_2, wrist_3; it has elbow, g"
    ):
        open_robot(ros2_cell.place("eye", reconnect_s=0.2)).state()


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
def test_what_goes_wrong_is_a_line(ros2_cell, fault, error):
    """Stamps that stand still, silence and too few states end in one line."""
    robot = open_robot(ros2_cell.place("eye", reconnect_s=0.2))
    robot.state()
    ros2_cell.tell(*fault.split())
    with pytest.raises(DriverError, match=error) as raised:
        [robot.state() for _ in range(60)]
    assert "\n" not in str(raised.value)


def test_images_of_another_size_are_told(ros2_cell):
    """Where the cell states the size of images, others are no images of this camera."""
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
def test_options_that_are_wrong(tmp_path, open_it, name, options, error):
    """They are told with their field before anything is asked of the network."""
    with pytest.raises(DatasetError, match=error):
        open_it(Place(name, CELL, tmp_path, {"domain": DOMAIN, **options}))


def test_joint_states_need_a_urdf(tmp_path):
    """Of a robot without one poses or frames can be read."""
    with pytest.raises(DatasetError, match=r"robots\.arm\.driver: joint states need urdf"):
        open_robot(Place("arm", Cell("arm", {"arm": Robot("arm")}), tmp_path, {"domain": DOMAIN}))


@pytest.mark.slow
def test_two_processes_that_send_one_topic_are_named(ros2_cell):
    """A second process that sends the same joints is refused with both processes; once it has ended, states go on."""
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
