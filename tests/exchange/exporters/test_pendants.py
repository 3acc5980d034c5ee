"""Tests of poses in pendant notation, read back by SciPy."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.exchange.exporters.pendants import PENDANTS, line_exporter
from export_example import BASE, CALIBRATION, FIXED, INVERSE, MOUNT, POSE, all_poses, wanted

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
def test_scipy_restores_pendant_rotation(controller: str, name: str) -> None:
    """Angles are in degrees about the maker's axes, after the millimetres."""
    form, axes = FORMS[controller]
    (found,) = re.findall(form, PENDANTS[controller].text(wanted(name)), re.MULTILINE)
    numbers, (one,) = np.array([float(number) for number in found]), wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(numbers[:3] * 1e-3, mean.translation, atol=1e-6)
    turned = Rotation.from_euler(axes, numbers[3:], degrees=True).as_matrix()
    np.testing.assert_allclose(turned, mean.rotation, atol=1e-5)


def test_every_pendant_format_is_tested() -> None:
    """All formats but URScript, KRL and RAPID write six angles or lengths on one line."""
    assert PENDANTS.keys() == {"ur", "kuka", "abb", *FORMS}


def test_yaskawa_export_names_its_numbers() -> None:
    """The numbers are also written with their names, for typing."""
    text = PENDANTS["yaskawa"].text(wanted())
    assert re.search(r"^X \S+, Y \S+, Z \S+, Rx \S+, Ry \S+, Rz \S+$", text, re.MULTILINE)


def pose_of(text):
    (numbers,) = re.findall(r"^p\[(.+)\]$", text, re.MULTILINE)
    return np.array([float(number) for number in numbers.split(", ")])


@pytest.mark.parametrize("name", all_poses())
def test_scipy_restores_urscript_rotation(name):
    """Metres come first, to the written digits."""
    numbers, (one,) = pose_of(PENDANTS["ur"].text(wanted(name))), wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(numbers[:3], mean.translation, atol=1e-6)
    np.testing.assert_allclose(Rotation.from_rotvec(numbers[3:]).as_matrix(), mean.rotation, atol=1e-5)


def test_fixed_pose_has_nine_decimals():
    """A fixed pose is written to 1e-9."""
    np.testing.assert_allclose(pose_of(PENDANTS["ur"].text(wanted(FIXED))), [0.1, 0.2, 0.3, 0.1, 0.2, 0.3], atol=1e-9)
    assert "p[0.100000000, 0.200000000, 0.300000000, 0.100000000, 0.200000000, 0.300000000]" in PENDANTS["ur"].text(
        wanted(FIXED)
    )


def test_urscript_has_only_comments_and_poses():
    """Every line is a comment that begins with #, or a pose."""
    lines = PENDANTS["ur"].text(wanted()).splitlines()
    assert [line[:2] for line in lines] == ["# ", "# ", "p["]
    assert f"# {BASE}: the pose of hand_base in eye_base, m and rotation vector in rad; " in lines[1]
    assert lines[2].startswith(f"p[{POSE.translation[0]:.6f}, -0.400000, 0.050000, ")
    assert CALIBRATION[BASE].sigma_t.min() == pytest.approx(2e-4)


def test_remarks_precede_commented_transforms():
    """Comments begin with the format's mark; lines are made of the transform and the request."""
    exporter = line_exporter("numbers", "%", "in words", lambda one, request: [one.name, request.calibration.verdict])
    lines = exporter.text(wanted(FIXED)).splitlines()
    assert lines[-2:] == [FIXED, "good"]
    assert lines[-3].startswith(f"% {FIXED}: ")
    assert ", in words; " in lines[-3]
    assert all(line.startswith("% ") for line in lines[:-2])
    assert (exporter.words, exporter.options, exporter.is_pasted) == ("numbers", ("transform",), True)
    assert f"% {BASE}: " in exporter.text(wanted(BASE))


def frames_of(text):
    found = re.findall(r"^([$A-Z=]*)\{X (\S+), Y (\S+), Z (\S+), A (\S+), B (\S+), C (\S+)\}", text, re.MULTILINE)
    return {name: np.array([float(number) for number in numbers]) for name, *numbers in found}


@pytest.mark.parametrize("name", all_poses())
def test_scipy_restores_krl_rotation(name):
    """A, B, C are about z, the new y and the new x in degrees, after the millimetres."""
    numbers, (one,) = frames_of(PENDANTS["kuka"].text(wanted(name)))[""], wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(numbers[:3] * 1e-3, mean.translation, atol=1e-6)
    turned = Rotation.from_euler("ZYX", numbers[3:], degrees=True).as_matrix()
    np.testing.assert_allclose(turned, mean.rotation, atol=1e-5)


def test_krl_settings_follow_transform_kind():
    """A base in a base sets `$BASE` and `$ROBROOT`, a frame on a flange sets `$TOOL`, others set no variable."""
    assert list(frames_of(PENDANTS["kuka"].text(wanted(BASE)))) == ["", "$BASE=", "$ROBROOT="]
    assert list(frames_of(PENDANTS["kuka"].text(wanted(MOUNT)))) == ["", "$TOOL="]
    assert list(frames_of(PENDANTS["kuka"].text(wanted("board_from_hand_flange")))) == [""]
    for frame in frames_of(PENDANTS["kuka"].text(wanted(BASE))).values():
        np.testing.assert_array_equal(frame, frames_of(PENDANTS["kuka"].text(wanted(BASE)))[""])


def test_krl_comment_names_controller():
    """The base of `hand` in `eye` is set on `eye`; its inverse on `hand`."""
    assert "; on eye, its $ROBROOT zero: poses are then in hand_base" in PENDANTS["kuka"].text(wanted(BASE))
    assert "; on hand: its WORLD is then eye_base" in PENDANTS["kuka"].text(wanted(BASE))
    assert "; on hand, its $ROBROOT zero: poses are then in eye_base" in PENDANTS["kuka"].text(wanted(INVERSE))
    assert "; on eye: poses are then those of wrist" in PENDANTS["kuka"].text(wanted(MOUNT))


def test_krl_has_only_comments_frames_and_settings():
    """Every line is valid KRL."""
    for line in PENDANTS["kuka"].text(wanted()).splitlines() + PENDANTS["kuka"].text(wanted(FIXED)).splitlines():
        assert re.match(r"; |\{X |\$[A-Z]+=\{X ", line)


def rapid_pose(text):
    (found,) = re.findall(r"^(\[\[.+\]\])$", text, re.MULTILINE)
    place, quaternion = json.loads(found)
    return np.array(place), np.array(quaternion)


@pytest.mark.parametrize("name", all_poses())
def test_scipy_restores_rapid_rotation(name):
    """The quaternion has its scalar first and norm 1, after the millimetres."""
    (place, quaternion), (one,) = rapid_pose(PENDANTS["abb"].text(wanted(name))), wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(place * 1e-3, mean.translation, atol=1e-6)
    np.testing.assert_allclose(Rotation.from_quat(quaternion, scalar_first=True).as_matrix(), mean.rotation, atol=1e-5)
    assert np.linalg.norm(quaternion) == pytest.approx(1, abs=2e-6)


def test_rapid_base_is_work_object_and_base_frame():
    """The work object has the pose as its user frame; the base frame is in metres."""
    text = PENDANTS["abb"].text(wanted(BASE))
    pose = re.findall(r"^(\[\[.+\]\])$", text, re.MULTILINE)[0]
    assert f'PERS wobjdata wobj_hand_base:=[FALSE,TRUE,"",{pose},[[0,0,0],[1,0,0,0]]];' in text
    assert "! Base Frame of hand, where the world is eye_base: x 0.812346, y -0.400000, z 0.050000 [m], q1 " in text
    assert "wobjdata" not in PENDANTS["abb"].text(wanted(MOUNT))


def test_rapid_names_have_at_most_32_characters():
    """Names of work objects are at most 32 characters long."""
    names = re.findall(r"wobjdata (\w+):=", PENDANTS["abb"].text(wanted(BASE)))
    assert names
    assert max(map(len, names)) <= 32
