"""OpenCV's seven methods, as their users use them.

One arm: `calibrateHandEye` and `calibrateRobotWorldHandEye`. Two arms: as easy_handeye advises, calibrate twice and
concatenate. While the hand is still, the eye robot's camera is calibrated to its flange. While the eye is still, the
hand robot is calibrated to the camera, which is then fixed. They meet at the camera,

    eye_base_from_hand_base = eye_base_from_eye_flange @ eye_flange_from_camera @ camera_from_hand_base

at the pose where the eye stood still, or at the target where the hand stood still; both are tried.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple, Protocol

from basecal.geometry import SE3
from basecal.vision.robot_world import METHODS, robot_world
from benchmarks.peers.task import DesignName, Task

CHAINS = (", by the camera", ", by the target")


class OneArm(NamedTuple):
    """The constants of a run in which one arm moves: the mount on its flange, and the target in its base."""

    flange_from_camera: SE3
    base_from_target: SE3


class TwoArms(NamedTuple):
    """All three unknowns of two arms."""

    eye_base_from_hand_base: SE3
    eye_flange_from_camera: SE3
    hand_flange_from_target: SE3


Results = Mapping[str, OneArm | TwoArms | None]


def one_arm(method: str, base_from_flange: SE3, camera_from_target: SE3) -> OneArm | None:
    """Calibrate one arm by one of `METHODS`; None if it fails.

    For a camera beside the arm give `flange_from_base` for `base_from_flange`: the mount is then `base_from_camera`,
    and the other end `flange_from_target`.
    """
    result = robot_world(camera_from_target, base_from_flange.inverse(), method)
    return None if result is None else OneArm(result.first.inverse(), result.last)


class Run(Protocol):
    """A run in which one arm moves: poses of both flanges and of the target in the camera, (n,) each."""

    @property
    def eye(self) -> SE3:
        """eye_base_from_eye_flange."""
        ...

    @property
    def views(self) -> SE3:
        """camera_from_target."""
        ...

    @property
    def hand(self) -> SE3:
        """hand_base_from_hand_flange."""
        ...


def concatenate(method: str, hand_still: Run, eye_still: Run) -> list[TwoArms]:
    """Two calibrations by one of `METHODS`, concatenated at the camera and at the target; empty if one fails."""
    eye_in_hand = one_arm(method, hand_still.eye, hand_still.views)
    eye_to_hand = one_arm(method, eye_still.hand.inverse(), eye_still.views)
    if eye_in_hand is None or eye_to_hand is None:
        return []
    mount, eye_base_from_target = eye_in_hand
    hand_base_from_camera, other_mount = eye_to_hand
    at_camera = eye_still.eye[-1] @ mount @ hand_base_from_camera.inverse()
    at_target = eye_base_from_target @ (hand_still.hand[0] @ other_mount).inverse()
    return [TwoArms(base, mount, other_mount) for base in (at_camera, at_target)]


class _Half(NamedTuple):
    eye: SE3
    views: SE3
    hand: SE3


def two_arms(method: str, task: Task) -> Results:
    """Two calibrations of a recording in halves: the hand still in the first, the eye in the second."""
    eye, hand, views = task.eye_base_from_eye_flange, task.hand_base_from_hand_flange, task.camera_from_target
    assert hand is not None
    hand_still = len(views) - len(views) // 2
    halves = [_Half(eye[s], views[s], hand[s]) for s in (slice(None, hand_still), slice(hand_still, None))]
    results = concatenate(method, *halves)
    return dict(zip(CHAINS, results, strict=True)) if results else dict.fromkeys(CHAINS)


def _one_arm(method: str, task: Task) -> Results:
    return {"": one_arm(method, task.eye_base_from_eye_flange, task.camera_from_target)}


def works(task: Task, design: DesignName) -> dict[str, Callable[[], Results]]:
    """Calibrations of a recording of that design, by method; the requested transform comes first in each result.

    If both arms move the dictionary is empty: no method of OpenCV takes two moving arms.
    """
    if design == "both":
        return {}
    return {method: partial(two_arms if design == "halves" else _one_arm, method, task) for method in METHODS}
