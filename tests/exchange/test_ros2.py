"""Tests of lines to paste into ROS."""

from __future__ import annotations

import re
import shlex
import xml.etree.ElementTree

import numpy as np
import pytest

from basecal.exchange.ros2 import ros_covariance, static_transform_publisher
from basecal.exchange.urdf import origin_line
from basecal.geometry import SE3, PoseEstimate

POSES = [
    SE3.identity(),
    SE3.exp(np.array([1.0, -2.0, 0.5, 0.3, -0.7, 2.0])),
    SE3.from_rpy([0.1, np.pi / 2, 0.4], [0.0, -0.0, 1e-6]),
    SE3.from_rotvec([np.pi, 0.0, 0.0], [-1e-12, 0.0, 0.0]),
]


@pytest.mark.parametrize("pose", POSES)
def test_urdf_origin_restores_transform(pose: SE3) -> None:
    """A URDF reader gets the transform back from the line to 1e-8, also at gimbal lock."""
    origin = xml.etree.ElementTree.fromstring(origin_line(pose))
    xyz, rpy = ([float(word) for word in origin.attrib[key].split()] for key in ("xyz", "rpy"))
    np.testing.assert_allclose(SE3.from_rpy(rpy, xyz).matrix, pose.matrix, atol=1e-8)


@pytest.mark.parametrize("pose", POSES)
def test_static_publisher_restores_transform(pose: SE3) -> None:
    """The command's flags hold the transform to 1e-8, with parent and child in the right order."""
    line = static_transform_publisher(pose, "left_base", "right_base")
    flags = dict(re.findall(r"--([a-z-]+) (\S+)", line))
    q, t = ([float(flags[key]) for key in keys] for keys in (("qx", "qy", "qz", "qw"), ("x", "y", "z")))
    np.testing.assert_allclose(SE3.from_quaternion(q, t).matrix, pose.matrix, atol=1e-8)
    assert (flags["frame-id"], flags["child-frame-id"]) == ("left_base", "right_base")
    assert line.startswith("ros2 run tf2_ros static_transform_publisher --x ")


def test_negative_zero_is_not_written() -> None:
    """Zero is written without a sign, since some programs read "-0.000" after a flag as an option."""
    assert "-0.000000000" not in origin_line(POSES[3])


@pytest.mark.parametrize("name", ["b; touch PWNED $(touch PWNED) #", "'; touch PWNED '", "`x`", "a b", ""])
def test_frame_names_are_quoted_for_shell(name: str) -> None:
    """Whatever a frame is called, the shell takes the name as one word and runs none of it."""
    words = shlex.split(static_transform_publisher(POSES[0], name, "child"))
    assert words[words.index("--frame-id") + 1] == name
    assert words[-2:] == ["--child-frame-id", "child"]


@pytest.mark.journey
def test_ros_covariance_is_along_parent_axes() -> None:
    """The covariance matches 200000 draws of the child's origin and rotation in the parent's axes.

    A correlation has a sigma of 0.0022 with so many draws. The tolerance of 0.012 is five of these, and first order
    adds 1e-3 at most for sigmas of 2 mrad.
    """
    rng = np.random.default_rng(3)
    spread = rng.standard_normal((6, 6))
    sigmas = np.array([1e-3, 2e-3, 3e-3, 5e-4, 1e-3, 2e-3])
    correlation = np.corrcoef(spread)
    known = PoseEstimate(POSES[1], correlation * np.outer(sigmas, sigmas))
    truth = known.mean @ SE3.exp(rng.multivariate_normal(np.zeros(6), known.covariance, 200_000))
    moved = truth.translation - known.mean.translation
    turned = SE3(truth.rotation @ known.mean.rotation.T, moved).rotvec
    drawn, computed = np.cov(np.hstack([moved, turned]).T), ros_covariance(known)
    scale = np.sqrt(np.outer(np.diag(computed), np.diag(computed)))
    np.testing.assert_allclose(drawn / scale, computed / scale, atol=0.012)
