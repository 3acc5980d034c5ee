"""Tests of `basecal new CELL --from ros2`."""

from __future__ import annotations

import pytest

from basecal.cell.files import read_cell
from basecal.cli import main
from basecal.cli.new_from_ros2 import _add_drivers, _add_target
from basecal.exchange.bags.sources import BagSources, ByFrames, ByPoses, CameraSource

pytest.importorskip("cyclonedds")
from shared.ros2_domain import ros2


@pytest.mark.journey
def test_cell_is_made_from_running_nodes(tmp_path, capsys):
    """It has the robot with its URDF, the camera with its lens, and drivers that can capture at once."""
    with ros2(100, 30, 320, 240) as process:
        domain = process.domain
        words = ["new", str(tmp_path / "c"), "--from", "ros2", "--domain", str(domain), "--target", "led"]
        assert main(words) == 2
        assert f"connects to ROS 2 in domain {domain}" in capsys.readouterr().err
        assert main([*words, "--yes"]) == 0
    said = capsys.readouterr().out
    assert "/joint_states  sensor_msgs/msg/JointState" in said
    assert (
        "taking robot 'arm': /joint_states, 6 joints from base_link to tool0 by the URDF of /robot_description" in said
    )
    cell = read_cell(tmp_path / "c")
    arm, camera = cell.robots["arm"], cell.cameras["wrist"]
    assert arm.driver.kind == "ros2"
    assert arm.driver.options == {"topic": "/joint_states", "domain": domain}
    assert len(arm.chain.joint_names) == 6
    assert camera.driver.options == {"topic": "/wrist/image_raw", "domain": domain}
    assert (camera.on, camera.size_px) == ("arm", (320, 240))
    assert camera.intrinsics.camera.parameters[0] == 900
    assert cell.targets["target"].on == "world"


def test_contradictory_options_are_refused(tmp_path, capsys):
    """Names are those of running nodes; options of --from are refused without it."""
    assert main(["new", str(tmp_path / "c"), "--from", "ros2", "--robots", "2"]) == 2
    assert main(["new", str(tmp_path / "c"), "--domain", "3"]) == 2
    assert not (tmp_path / "c").exists()
    capsys.readouterr()


@pytest.mark.parametrize("domain", [None, 0, 3])
def test_drivers_listen_to_the_chosen_topics(domain):
    """Robots listen to frames or a topic, cameras to their topic, in the given domain; further bases are free."""
    data = {"reference": "a", "robots": {"a": {"urdf": "a.urdf"}}, "cameras": {"eye": {"on": "a"}}}
    robots = {"a": ByFrames("base", "tool"), "b": ByPoses("/b/pose")}
    where = {} if domain is None else {"domain": domain}
    _add_drivers(data, BagSources(robots, {"eye": CameraSource("/image", None, "a")}), domain)
    assert data["robots"] == {
        "a": {"urdf": "a.urdf", "driver": {"kind": "ros2", "frames": ["base", "tool"], **where}},
        "b": {"driver": {"kind": "ros2", "topic": "/b/pose", **where}},
    }
    assert data["cameras"] == {"eye": {"on": "a", "driver": {"kind": "ros2", "topic": "/image", **where}}}
    assert data["bases"] == {"b": {"status": "free"}}
    alone = {"reference": "a", "robots": {}, "cameras": {}}
    _add_drivers(alone, BagSources({"a": ByPoses("/a")}), domain)
    assert "bases" not in alone


@pytest.mark.parametrize(("robots", "on"), [(["a"], "world"), (["a", "b"], "b"), (["b", "a", "c"], "b")])
def test_target_is_not_on_the_first_cameras_carrier(robots, on):
    """It is on another robot than the camera, or on the world; one target serves all cameras, none without a camera."""
    data = {"robots": dict.fromkeys(robots), "cameras": {"eye": {"on": "a"}, "other": {"on": robots[-1]}}}
    _add_target(data, None, "charuco")
    assert list(data["targets"]) == ["target"]
    target = data["targets"]["target"]
    assert (target["on"], target["mount"], target["kind"]) == (on, {"status": "free"}, "charuco")
    data.pop("targets")
    _add_target(data, {"kind": "led"}, "led")
    assert data["targets"]["target"] == {"on": on, "mount": {"status": "free"}, "kind": "led"}
    data.pop("targets")
    _add_target(data, None, "pose")
    assert "kind" not in data["targets"]["target"]
    blind = {"robots": dict.fromkeys(robots)}
    _add_target(blind, None, "charuco")
    assert "targets" not in blind
