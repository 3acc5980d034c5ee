"""The paper's simulated cell and its printed numbers.

Source: "Base Calibration for Dual Robot System", section 4.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from basecal.estimation.axis_shift.closed_form import ShiftEstimate, estimate, image_gradient
from basecal.geometry import SE3, Array
from basecal.simulation.shifts import shift_directions


@dataclass(frozen=True, eq=False)
class Testbed:
    """The paper's simulated cell.

    Attributes:
        eye_base_from_camera: Pose of the camera.
        hand_base_from_led: Pose of the LED before its shifts.
        eye_base_from_hand_base: The printed base, whose rotation matrix is rounded.
        focal_px: (2,) focal lengths fu and fv [px].
        shift_m: Length of the shifts [m].
    """

    eye_base_from_camera: SE3
    hand_base_from_led: SE3
    eye_base_from_hand_base: SE3
    focal_px: Array
    shift_m: float

    @property
    def camera_from_led(self) -> SE3:
        """The printed true pose of the LED, with its rounded rotation matrix."""
        eye_base_from_led = self.eye_base_from_hand_base @ self.hand_base_from_led
        return self.eye_base_from_camera.inverse() @ eye_base_from_led

    def image(self, camera_from_led: SE3, shift_m: float) -> Array:
        """Image coordinates of the LED about the principal point, before and after its shifts, (4, 2) [px]."""
        at = camera_from_led @ (shift_m * shift_directions(is_two_sided=False))
        image: Array = self.focal_px * at[:, :2] / at[:, 2:]
        return image

    def closed_form(self, image: Array, shift_m: float) -> ShiftEstimate:
        """The paper's estimate from image coordinates, (..., 4, 2)."""
        gradient = image_gradient(image[..., 1:, :] - image[..., :1, :], shift_m * np.eye(3))
        return estimate(image[..., 0, :], gradient, self.focal_px)


def paper_numbers() -> dict[str, Any]:
    """The printed numbers of the paper, and its errata."""
    numbers: dict[str, Any] = json.loads(files("basecal.studies").joinpath("paper_numbers.json").read_text("utf-8"))
    return numbers


def paper_cell(numbers: dict[str, Any]) -> Testbed:
    """The paper's cell from its printed numbers."""
    t = numbers["testbed"]
    focal = np.array([t["focal_px"]["fu"], t["focal_px"]["fv"]])
    printed = printed_pose(t["eye_base_from_hand_base_true"])
    return Testbed(
        printed_pose(t["eye_base_from_camera"]), printed_pose(t["hand_base_from_led"]), printed, focal, t["shift"]
    )


def printed_pose(entry: dict[str, Any]) -> SE3:
    """A pose with the printed numbers, whose rounded rotation matrix is not exactly orthonormal."""
    return SE3.adopt(np.array(entry["R"], dtype=np.float64), np.array(entry["t"], dtype=np.float64))
