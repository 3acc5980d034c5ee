"""URScript."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.exchange.exporters.ur import EXPORTER
from export_example import BASE, CALIBRATION, FIXED, POSE, all_poses, wanted


def pose_of(text):
    (numbers,) = re.findall(r"^p\[(.+)\]$", text, re.MULTILINE)
    return np.array([float(number) for number in numbers.split(", ")])


@pytest.mark.parametrize("name", all_poses())
def test_scipy_gives_the_rotation_back(name):
    """And the metres stand first, to the digits written."""
    numbers, (one,) = pose_of(EXPORTER.text(wanted(name))), wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(numbers[:3], mean.translation, atol=1e-6)
    np.testing.assert_allclose(Rotation.from_rotvec(numbers[3:]).as_matrix(), mean.rotation, atol=1e-5)


def test_what_is_exact_has_nine_decimals():
    """A fixed pose is given to 1e-9."""
    np.testing.assert_allclose(pose_of(EXPORTER.text(wanted(FIXED))), [0.1, 0.2, 0.3, 0.1, 0.2, 0.3], atol=1e-9)
    assert "p[0.100000000, 0.200000000, 0.300000000, 0.100000000, 0.200000000, 0.300000000]" in EXPORTER.text(
        wanted(FIXED)
    )


def test_only_comments_and_poses():
    """Lines of URScript: a comment begins with #."""
    lines = EXPORTER.text(wanted()).splitlines()
    assert [line[:2] for line in lines] == ["# ", "# ", "p["]
    assert f"# {BASE}: the pose of hand_base in eye_base, m and rotation vector in rad; " in lines[1]
    assert lines[2].startswith(f"p[{POSE.translation[0]:.6f}, -0.400000, 0.050000, ")
    assert CALIBRATION[BASE].sigma_t.min() == pytest.approx(2e-4)
