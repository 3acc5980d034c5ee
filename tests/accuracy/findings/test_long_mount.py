"""Tests of the finding `long-mount`: mounts that look exchanged with bases."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Literal

import numpy as np
import pytest

from basecal.accuracy.arrays.array_calibration import ArrayCalibration
from basecal.accuracy.arrays.functions import hand_eye
from basecal.accuracy.findings.long_mount import long_mount
from basecal.cell import WORLD
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


def calibrate_arrays(gripper: SE3, camera_on: Literal["robot", "world"]) -> ArrayCalibration:
    return hand_eye(gripper.rotation, gripper.translation, SEEN.rotation, SEEN.translation, camera_on=camera_on)


@pytest.mark.journey
def test_inverse_poses_of_still_camera_are_doubtful() -> None:
    """Inverse poses of a still camera, as on OpenCV's page, are doubtful.

    A cell with the camera on the arm fits as exactly, with a mount of a metre.
    """
    found = calibrate_arrays(ARM.inverse(), "robot")
    assert found.verdict == "doubtful"
    (finding,) = found.findings
    assert (finding.code, finding.severity, finding.about) == ("long-mount", "warning", ("gripper",))
    assert finding.what.startswith("camera is 1.07 m from the flange of the gripper, and target 0.10 m from its base.")
    assert finding.do[-1] == "If camera is not on the gripper, give the inverse poses, with camera_on='world'."


@pytest.mark.journey
def test_correct_poses_have_no_long_mount() -> None:
    """Correct poses with the camera on the world have no finding, nor has a stated mount."""
    assert calibrate_arrays(ARM, "world").findings == ()
    other = calibrate_arrays(ARM.inverse(), "robot")
    evidence = evidence_of(other.cell, solve(other.cell, other.recording))
    assert [finding.code for finding in long_mount(evidence)] == ["long-mount"]
    name = other.cell.mount_name("camera")
    stated = other.cell.with_transform(name, replace(other.cell.transforms[name], status="fixed", mean=STILL))
    assert long_mount(replace(evidence, cell=stated)) == []


def problems_of_cell(
    mount_m: float, stand_m: float, camera_on: str = "arm", joints: bool = False, **change: object
) -> list[str]:
    """Findings of a cell with one arm, whose carried device is so far from its flange."""
    on = {"camera": camera_on, "board": WORLD if camera_on == "arm" else "arm"}
    carried = "camera" if camera_on == "arm" else "board"
    devices = {name: {name: SimpleNamespace(on=on[name])} for name in on}
    at = {name: SE3.from_rotvec([0, 0, 0], [0.0, mount_m if name == carried else stand_m, 0.0]) for name in on}
    cell = SimpleNamespace(
        robots={"arm": None},
        cameras=devices["camera"],
        targets=devices["board"],
        mount_name=lambda name: name,
        transforms={name: SimpleNamespace(status="free") for name in on},
    )
    solution = SimpleNamespace(
        converged=change.pop("converged", True),
        state=SimpleNamespace(transforms=at),
        problem=SimpleNamespace(robot_ends=lambda robot: [SimpleNamespace(joints=np.zeros(6) if joints else None)]),
    )
    cell.__dict__.update(change)
    return [each.what for each in long_mount(SimpleNamespace(cell=cell, solution=solution))]  # type: ignore[arg-type]


@pytest.mark.parametrize("camera_on", ["arm", WORLD])
@pytest.mark.parametrize(
    ("mount_m", "stand_m", "named"),
    [(0.41, 0.1, True), (0.39, 0.1, False), (0.9, 0.44, True), (0.9, 0.46, False), (0.3, 0.01, False)],
)
def test_mount_is_long_from_forty_centimetres(mount_m: float, stand_m: float, named: bool, camera_on: str) -> None:
    """A mount is long from 40 cm on if it is also twice the other device's distance from the base.

    The carried device may be the camera or the target.
    """
    found = problems_of_cell(mount_m, stand_m, camera_on)
    assert len(found) == named
    carried, other = ("camera", "board") if camera_on == "arm" else ("board", "camera")
    for what in found:
        assert (
            what == f"{carried} is {mount_m:.2f} m from the flange of arm, and {other} {stand_m:.2f} m from its base."
        )


@pytest.mark.parametrize(
    "change",
    [
        {"robots": {"arm": None, "other": None}},
        {"cameras": {"camera": SimpleNamespace(on="arm"), "second": SimpleNamespace(on="arm")}},
        {"cameras": {}},
        {"targets": {"board": SimpleNamespace(on=WORLD), "second": SimpleNamespace(on=WORLD)}},
        {"targets": {"board": SimpleNamespace(on="arm")}},
        {"transforms": {"camera": SimpleNamespace(status="prior"), "board": SimpleNamespace(status="free")}},
        {"transforms": {"camera": SimpleNamespace(status="free"), "board": SimpleNamespace(status="fixed")}},
        {"converged": False},
        {"joints": True},
    ],
)
def test_exchanged_mounts_need_plain_cell(change: dict[str, object]) -> None:
    """The check needs one arm with recorded poses, one camera and one target.

    One of these is on the world, and both mounts are free.
    """
    assert len(problems_of_cell(1.0, 0.1)) == 1
    assert problems_of_cell(1.0, 0.1, **change) == []  # type: ignore[arg-type]
