"""Tests of findings in the terms of arrays."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

import basecal
from basecal.accuracy.arrays.array_calibration import ArrayCalibration
from basecal.accuracy.arrays.words import BASE_TO_BASE_WORDS, HAND_EYE_WORDS, rename_finding
from basecal.cell import Finding
from basecal.geometry import SE3

CHANCE = np.random.default_rng(8)
X, W, Y = (SE3.exp(CHANCE.normal(size=6) * np.repeat([0.1, 0.5], 3)) for _ in range(3))
SEEN = SE3.exp(np.c_[CHANCE.normal(0, 0.1, (14, 2)), CHANCE.normal(0.5, 0.1, 14), CHANCE.normal(0, 0.4, (14, 3))])
GRIPPER = W @ SEEN.inverse() @ X.inverse()
EYE = SE3.exp(CHANCE.normal(size=(14, 6)) * np.repeat([0.2, 0.5], 3))
HAND = Y.inverse() @ EYE @ X @ SEEN @ W.inverse()
OWN_WORDS = re.compile(r"eye_flange|hand_flange|_from_|cell\.yaml|`basecal|--\w|fix CELL")


def _hand_eye(gripper: SE3, seen: SE3, unit: float = 1.0) -> ArrayCalibration:
    return basecal.hand_eye(gripper.rotation, gripper.translation * unit, seen.rotation, seen.translation)


def _robot_world(seen: SE3, gripper: SE3) -> ArrayCalibration:
    return basecal.robot_world(seen.rotation, seen.translation, gripper.rotation, gripper.translation)


def _base_to_base(eye: SE3, hand: SE3, seen: SE3) -> ArrayCalibration:
    parts = [part for pose in (eye, hand, seen) for part in (pose.rotation, pose.translation)]
    return basecal.base_to_base(*parts)


def _transposed(pose: SE3) -> SE3:
    return SE3(np.swapaxes(pose.rotation, 1, 2), pose.translation)


@pytest.mark.journey
@pytest.mark.parametrize(
    ("call", "what", "do"),
    [
        (
            lambda: _hand_eye(GRIPPER.inverse(), SEEN),
            "The poses R_gripper2base, t_gripper2base are inverted (base2gripper), or camera is on world",
            "or give the other camera_on.",
        ),
        (
            lambda: _hand_eye(GRIPPER, SEEN.inverse()),
            "The poses R_target2cam, t_target2cam are inverted (cam2target).",
            "Give target2cam as R_target2cam, t_target2cam, or invert",
        ),
        (lambda: _hand_eye(GRIPPER, SEEN, 1000), "The poses R_gripper2base, t_gripper2base are in millimetres", ""),
        (
            lambda: _hand_eye(_transposed(GRIPPER), SEEN),
            "The matrices R_gripper2base are transposed.",
            "transpose them",
        ),
        (
            lambda: _robot_world(SEEN, GRIPPER),
            "The poses R_base2gripper, t_base2gripper are inverted (gripper2base)",
            "or call hand_eye with camera_on='world'.",
        ),
        (lambda: _base_to_base(HAND, EYE, SEEN), "The poses of eye and hand are exchanged.", "Exchange them."),
        (
            lambda: _base_to_base(EYE, HAND.inverse(), SEEN),
            "The poses R_hand_gripper2base, t_hand_gripper2base are inverted (base2gripper).",
            "Give hand_gripper2base as R_hand_gripper2base, t_hand_gripper2base, or invert the poses.",
        ),
    ],
)
def test_mix_ups_name_arguments(call: Callable[[], ArrayCalibration], what: str, do: str) -> None:
    """The finding names the given arrays, and no frame, file or command of a cell."""
    found = call()
    assert found.verdict == "refused"
    assert found.findings[0].what.startswith(what)
    assert do in " ".join(found.findings[0].do)
    assert not any(OWN_WORDS.search(each.message) for each in found.findings)
    assert found.findings[0].what.replace("'", "&#x27;") in found._repr_html_()


@pytest.mark.journey
def test_transforms_have_array_names() -> None:
    """A gripper that rotates about one axis leaves `cam2gripper` unobservable, under this name."""
    angles = np.c_[np.zeros((14, 2)), CHANCE.normal(size=14)]
    about_z = SE3(SE3.from_rpy(angles, np.zeros((14, 3))).rotation, GRIPPER.translation)
    finding = _hand_eye(about_z, (about_z @ X).inverse() @ W).findings[0]
    assert finding.about == ("cam2gripper", "target2base")
    assert finding.what.endswith("in gripper is unobservable (coupled with target2base).")
    assert finding.why.startswith("The gripper rotates about one axis, along")
    assert finding.do == ("Add poses that rotate the gripper by 30 deg and more about another axis.",)


def test_advice_about_files_is_removed() -> None:
    """Commands and clauses that begin with `or` are removed; names inside other words stay."""
    do = ("Record at least 12 stops, or state `noise` in cell.yaml.", "`basecal fix CELL` does.", "See the eyelet.")
    found = rename_finding(Finding("x", "info", ("eye", "3"), "eye moved. eye rests.", do), HAND_EYE_WORDS)
    assert found.do == ("Record at least 12 stops.", "See the eyelet.")
    assert (found.about, found.what) == (("gripper", "3"), "The gripper moved. The gripper rests.")


@pytest.mark.parametrize("command", ["Run `basecal fix CELL`.", "Write it in cell.yaml.", "Give --guess to it."])
def test_advice_for_files_only_is_removed(command: str) -> None:
    """Other advice keeps its order, reasons are renamed as well, and an empty subject stays empty."""
    finding = Finding("x", "warning", (), "Poses of eye.", ("First.", command, "poses of eye last."), "eye is still.")
    found = rename_finding(finding, HAND_EYE_WORDS)
    assert found.do == ("First.", "poses R_gripper2base, t_gripper2base last.")
    assert (found.about, found.why, found.code, found.severity) == ((), "The gripper is still.", "x", "warning")


def test_longest_phrase_is_renamed() -> None:
    """The longest of the phrases with the same start is renamed; a name inside another word stays."""
    assert BASE_TO_BASE_WORDS["hand_flange"] == "hand_gripper"
    words = {"eye": "A", "poses of eye": "B", "poses of eye and hand": "C"}
    what = "poses of eye and hand, poses of eye, eye, eyes, my_eye, eye_base."
    assert rename_finding(Finding("x", "info", ("eye",), what), words).what == "C, B, A, eyes, my_eye, eye_base."
