"""RAPID."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.exchange.exporters.abb import EXPORTER
from export_example import BASE, MOUNT, all_poses, wanted


def pose_of(text):
    (found,) = re.findall(r"^(\[\[.+\]\])$", text, re.MULTILINE)
    place, quaternion = json.loads(found)
    return np.array(place), np.array(quaternion)


@pytest.mark.parametrize("name", all_poses())
def test_scipy_gives_the_rotation_back(name):
    """The quaternion has its scalar first and norm 1; mm stand before it."""
    (place, quaternion), (one,) = pose_of(EXPORTER.text(wanted(name))), wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(place * 1e-3, mean.translation, atol=1e-6)
    np.testing.assert_allclose(Rotation.from_quat(quaternion, scalar_first=True).as_matrix(), mean.rotation, atol=1e-5)
    assert np.linalg.norm(quaternion) == pytest.approx(1, abs=2e-6)


def test_a_base_is_a_work_object_and_a_base_frame():
    """The work object has the pose as its user frame; the base frame is said in metres."""
    text = EXPORTER.text(wanted(BASE))
    pose = re.findall(r"^(\[\[.+\]\])$", text, re.MULTILINE)[0]
    assert f'PERS wobjdata wobj_hand_base:=[FALSE,TRUE,"",{pose},[[0,0,0],[1,0,0,0]]];' in text
    assert "! Base Frame of hand, where the world is eye_base: x 0.812346, y -0.400000, z 0.050000 [m], q1 " in text
    assert "wobjdata" not in EXPORTER.text(wanted(MOUNT))


def test_a_name_of_rapid_is_short():
    """At most 32 characters."""
    names = re.findall(r"wobjdata (\w+):=", EXPORTER.text(wanted(BASE)))
    assert names
    assert max(map(len, names)) <= 32
