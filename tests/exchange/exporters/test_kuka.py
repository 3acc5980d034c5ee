"""KRL."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.exchange.exporters.kuka import EXPORTER
from export_example import BASE, FIXED, INVERSE, MOUNT, all_poses, wanted


def frames_of(text):
    found = re.findall(r"^([$A-Z=]*)\{X (\S+), Y (\S+), Z (\S+), A (\S+), B (\S+), C (\S+)\}", text, re.MULTILINE)
    return {name: np.array([float(number) for number in numbers]) for name, *numbers in found}


@pytest.mark.parametrize("name", all_poses())
def test_scipy_gives_the_rotation_back(name):
    """A, B, C about z, the new y, the new x in degrees; mm stand first."""
    numbers, (one,) = frames_of(EXPORTER.text(wanted(name)))[""], wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(numbers[:3] * 1e-3, mean.translation, atol=1e-6)
    turned = Rotation.from_euler("ZYX", numbers[3:], degrees=True).as_matrix()
    np.testing.assert_allclose(turned, mean.rotation, atol=1e-5)


def test_lines_set_what_the_transform_is():
    """A base in a base is `$BASE` and `$ROBROOT`, what is on a flange is `$TOOL`, what is on neither sets nothing."""
    assert list(frames_of(EXPORTER.text(wanted(BASE)))) == ["", "$BASE=", "$ROBROOT="]
    assert list(frames_of(EXPORTER.text(wanted(MOUNT)))) == ["", "$TOOL="]
    assert list(frames_of(EXPORTER.text(wanted("board_from_hand_flange")))) == [""]
    for frame in frames_of(EXPORTER.text(wanted(BASE))).values():
        np.testing.assert_array_equal(frame, frames_of(EXPORTER.text(wanted(BASE)))[""])


def test_whose_controller_is_said():
    """The base of `hand` in `eye` is set on `eye`; the other way round on `hand`."""
    assert "; on eye, its $ROBROOT zero: poses are then in hand_base" in EXPORTER.text(wanted(BASE))
    assert "; on hand: its WORLD is then eye_base" in EXPORTER.text(wanted(BASE))
    assert "; on hand, its $ROBROOT zero: poses are then in eye_base" in EXPORTER.text(wanted(INVERSE))
    assert "; on eye: poses are then those of wrist" in EXPORTER.text(wanted(MOUNT))


def test_only_comments_frames_and_settings():
    """Every line is one of KRL's."""
    for line in EXPORTER.text(wanted()).splitlines() + EXPORTER.text(wanted(FIXED)).splitlines():
        assert re.match(r"; |\{X |\$[A-Z]+=\{X ", line)
