"""`basecal new CELL --from ros2`."""

from __future__ import annotations

import pytest

from basecal.cell.files import read_cell
from basecal.cli import main

pytest.importorskip("cyclonedds")
from shared.ros2_domain import ros2


@pytest.mark.journey
def test_a_cell_of_what_runs(tmp_path, capsys):
    """It has the robot with its URDF, the camera with its lens, and drivers with which it can be captured at once."""
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


def test_what_does_not_go_together(tmp_path, capsys):
    """Names are those of what runs; options of --from alone are refused without it."""
    assert main(["new", str(tmp_path / "c"), "--from", "ros2", "--robots", "2"]) == 2
    assert main(["new", str(tmp_path / "c"), "--domain", "3"]) == 2
    assert not (tmp_path / "c").exists()
    capsys.readouterr()
