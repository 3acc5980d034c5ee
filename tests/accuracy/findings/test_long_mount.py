"""Mounts that look exchanged with bases."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from basecal.accuracy.arrays.array_calibration import ArrayCalibration
from basecal.accuracy.arrays.functions import hand_eye
from basecal.accuracy.findings.long_mount import long_mount
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from evidence import evidence_of

CHANCE = np.random.default_rng(6)
COUNT = 14
STILL = SE3.exp([1.0, 0.1, 0.5, 1.0, 0.4, -0.6])  # base from a camera beside the arm
BOARD = SE3.exp([0.0, 0.03, 0.1, 0.1, 0.0, 0.4])  # flange from the board on it
SEEN = SE3.exp(
    np.c_[CHANCE.normal(0, 0.1, (COUNT, 2)), CHANCE.normal(0.5, 0.1, COUNT), CHANCE.normal(0, 0.4, (COUNT, 3))]
)
ARM = STILL @ SEEN @ BOARD.inverse() @ SE3.exp(CHANCE.normal(size=(COUNT, 6)) * np.repeat([2e-4, 4e-4], 3))


def calibrated(gripper: SE3, camera_on: Literal["robot", "world"]) -> ArrayCalibration:
    return hand_eye(gripper.rotation, gripper.translation, SEEN.rotation, SEEN.translation, camera_on=camera_on)


def test_inverse_poses_of_a_still_camera_are_doubted() -> None:
    """OpenCV's page has them so; a cell with the camera on the arm fits as exactly, and names a mount of a metre."""
    found = calibrated(ARM.inverse(), "robot")
    assert found.verdict == "doubtful"
    (finding,) = found.findings
    assert (finding.code, finding.severity, finding.about) == ("long-mount", "warning", ("gripper",))
    assert finding.what.startswith("camera is 1.07 m from the flange of the gripper, and target 0.10 m from its base.")
    assert finding.do[-1] == "If camera is not on the gripper, give the inverse poses, with camera_on='world'."


def test_poses_in_order_are_not() -> None:
    """The camera is on the world; a mount that is stated is no answer."""
    assert calibrated(ARM, "world").findings == ()
    other = calibrated(ARM.inverse(), "robot")
    evidence = evidence_of(other.cell, solve(other.cell, other.recording))
    assert [finding.code for finding in long_mount(evidence)] == ["long-mount"]
    name = other.cell.mount_name("camera")
    stated = other.cell.with_transform(name, replace(other.cell.transforms[name], status="fixed", mean=STILL))
    assert long_mount(replace(evidence, cell=stated)) == []
