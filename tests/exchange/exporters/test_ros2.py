"""Tests of the export of ROS 2 launch files."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest

from basecal.exchange.exporters.ros2 import export_text
from basecal.geometry import SE3
from export_example import BASE, all_poses, wanted


@pytest.fixture
def launch(monkeypatch):
    """Stub the imports of a launch file, and keep the node arguments."""
    for name, member, kept in (
        ("launch", "LaunchDescription", lambda nodes: nodes),
        ("launch_ros", "", None),
        ("launch_ros.actions", "Node", lambda **arguments: arguments),
    ):
        module = ModuleType(name)
        setattr(module, member or "actions", kept)
        monkeypatch.setitem(sys.modules, name, module)

    def run(text):
        names: dict[str, object] = {}
        exec(compile(text, "cell.launch.py", "exec"), names)
        return names["generate_launch_description"]()

    return run


@pytest.mark.parametrize("name", all_poses())
def test_launch_nodes_publish_transform(name, launch):
    """Python runs the file, and the flags hold the transform to 1e-8, whatever characters frames have."""
    (one,) = wanted(name).transforms
    (node,) = launch(export_text(wanted(name)))
    assert (node["package"], node["executable"], node["name"]) == ("tf2_ros", "static_transform_publisher", name)
    words = node["arguments"]
    flags = dict(zip(words[::2], words[1::2], strict=True))
    q, t = ([float(flags[f"--{key}"]) for key in keys] for keys in (("qx", "qy", "qz", "qw"), "xyz"))
    np.testing.assert_allclose(SE3.from_quaternion(q, t).matrix, one.estimate.mean.matrix, atol=1e-8)
    assert (flags["--frame-id"], flags["--child-frame-id"]) == (one.parent, one.child)


def test_launch_file_has_command_in_comment():
    """The command without a launch file is in a comment."""
    assert "# ros2 run tf2_ros static_transform_publisher --x 0.812345679 " in export_text(wanted(BASE))
