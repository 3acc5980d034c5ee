"""Poses as pendants take them, read back by SciPy."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.exchange.exporters.pendants import PENDANTS
from export_example import BASE, CALIBRATION, FIXED, POSE, all_poses, wanted

FORMS = {
    "fanuc": (r"^X = (\S+) mm, Y = (\S+) mm, Z = (\S+) mm,\nW = (\S+) deg, P = (\S+) deg, R = (\S+) deg$", "xyz"),
    "yaskawa": (r"^////BUSER ([^,]+),([^,]+),([^,]+),([^,]+),([^,]+),([^,]+)$", "xyz"),
    "staubli": (r"^\{(\S+), (\S+), (\S+), (\S+), (\S+), (\S+)\}$", "XYZ"),
    "denso": (r"^P\((\S+), (\S+), (\S+), (\S+), (\S+), (\S+)\)$", "xyz"),
    "doosan": (r"^posx\((\S+), (\S+), (\S+), (\S+), (\S+), (\S+)\)$", "ZYZ"),
    "xarm": (r"^\[(\S+), (\S+), (\S+), (\S+), (\S+), (\S+)\]$", "xyz"),
}
"""The line of each, and the axes of its angles: small letters are fixed, capital ones turn along."""


@pytest.mark.parametrize("controller", FORMS)
@pytest.mark.parametrize("name", all_poses())
def test_scipy_gives_the_rotation_back(controller: str, name: str) -> None:
    """Angles in degrees about its axes; mm stand first."""
    form, axes = FORMS[controller]
    (found,) = re.findall(form, PENDANTS[controller].text(wanted(name)), re.MULTILINE)
    numbers, (one,) = np.array([float(number) for number in found]), wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(numbers[:3] * 1e-3, mean.translation, atol=1e-6)
    turned = Rotation.from_euler(axes, numbers[3:], degrees=True).as_matrix()
    np.testing.assert_allclose(turned, mean.rotation, atol=1e-5)


def test_every_pendant_is_tried() -> None:
    """All but URScript write angles."""
    assert PENDANTS.keys() == {"ur", *FORMS}


def test_yaskawa_names_its_numbers_too() -> None:
    """For who types them."""
    text = PENDANTS["yaskawa"].text(wanted())
    assert re.search(r"^X \S+, Y \S+, Z \S+, Rx \S+, Ry \S+, Rz \S+$", text, re.MULTILINE)


def pose_of(text):
    (numbers,) = re.findall(r"^p\[(.+)\]$", text, re.MULTILINE)
    return np.array([float(number) for number in numbers.split(", ")])


@pytest.mark.parametrize("name", all_poses())
def test_scipy_gives_the_rotation_of_urscript_back(name):
    """And the metres stand first, to the digits written."""
    numbers, (one,) = pose_of(PENDANTS["ur"].text(wanted(name))), wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(numbers[:3], mean.translation, atol=1e-6)
    np.testing.assert_allclose(Rotation.from_rotvec(numbers[3:]).as_matrix(), mean.rotation, atol=1e-5)


def test_what_is_exact_has_nine_decimals():
    """A fixed pose is given to 1e-9."""
    np.testing.assert_allclose(pose_of(PENDANTS["ur"].text(wanted(FIXED))), [0.1, 0.2, 0.3, 0.1, 0.2, 0.3], atol=1e-9)
    assert "p[0.100000000, 0.200000000, 0.300000000, 0.100000000, 0.200000000, 0.300000000]" in PENDANTS["ur"].text(
        wanted(FIXED)
    )


def test_only_comments_and_poses():
    """Lines of URScript: a comment begins with #."""
    lines = PENDANTS["ur"].text(wanted()).splitlines()
    assert [line[:2] for line in lines] == ["# ", "# ", "p["]
    assert f"# {BASE}: the pose of hand_base in eye_base, m and rotation vector in rad; " in lines[1]
    assert lines[2].startswith(f"p[{POSE.translation[0]:.6f}, -0.400000, 0.050000, ")
    assert CALIBRATION[BASE].sigma_t.min() == pytest.approx(2e-4)
