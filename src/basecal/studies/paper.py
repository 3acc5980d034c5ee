"""The paper's simulations beside ours: its tables, its noise, the order of orthonormalising, the length of the shifts.

Source: "Base Calibration for Dual Robot System", section 4. The noise is read as multiplicative and Gaussian on each
image coordinate of the light about the principal point: of the readings tried, the only one that explains Table 1.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from basecal.estimation.axis_shift.closed_form import (
    ShiftEstimate,
    base_of_station,
    estimate,
    image_gradient,
    orthonormalised,
)
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.view_pose import refined
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.rotation import nearest_rotation, rotation_log
from basecal.simulation.shifts import shift_directions

DRAWS = 10_000
LENGTHS = (0.01, 0.02, 0.03, 0.06, 0.1, 0.2, 0.3, 0.6)
LENGTH_DRAWS = 5_000
SIGMA_PX = 0.1
_LEVELS = {"1%": 0.01, "5%": 0.05}


@dataclass(frozen=True, eq=False)
class Testbed:
    """The paper's simulated cell.

    Attributes:
        eye_base_from_camera: Where the camera stands.
        hand_base_from_light: Where the light is before its shifts.
        eye_base_from_hand_base: The printed base, whose rotation is a rounded one.
        focal_px: (2,) fu and fv.
        shift_m: Length of the shifts.
    """

    eye_base_from_camera: SE3
    hand_base_from_light: SE3
    eye_base_from_hand_base: SE3
    focal_px: Array
    shift_m: float

    @property
    def camera_from_light(self) -> SE3:
        """The printed truth, rounded rotation and all."""
        eye_base_from_light = self.eye_base_from_hand_base @ self.hand_base_from_light
        return self.eye_base_from_camera.inverse() @ eye_base_from_light

    def image(self, camera_from_light: SE3, shift_m: float) -> Array:
        """Image coordinates about the principal point of the light, before and after its shifts, (4, 2) [px]."""
        at = camera_from_light @ (shift_m * shift_directions(two_sided=False))
        image: Array = self.focal_px * at[:, :2] / at[:, 2:]
        return image

    def closed_form(self, image: Array, shift_m: float) -> ShiftEstimate:
        """The paper's estimate from image coordinates, (..., 4, 2)."""
        gradient = image_gradient(image[..., 1:, :] - image[..., :1, :], shift_m * np.eye(3))
        return estimate(image[..., 0, :], gradient, self.focal_px)


def paper_numbers() -> dict[str, Any]:
    """The figures that the paper prints, and its slips."""
    numbers: dict[str, Any] = json.loads(files("basecal.studies").joinpath("paper_numbers.json").read_text("utf-8"))
    return numbers


def testbed(numbers: dict[str, Any]) -> Testbed:
    """The paper's cell."""
    t = numbers["testbed"]
    focal = np.array([t["focal_px"]["fu"], t["focal_px"]["fv"]])
    printed = _pose(t["eye_base_from_hand_base_true"])
    return Testbed(_pose(t["eye_base_from_camera"]), _pose(t["hand_base_from_led"]), printed, focal, t["shift"])


def study_paper(seed: int = 0, draws: int = DRAWS, length_draws: int = LENGTH_DRAWS) -> dict[str, Any]:
    """Everything the paper simulates, ours in the keys of its figures, with the paper's under `paper`.

    Args:
        seed: Of the noise.
        draws: Of the 1 % and 5 % noise.
        length_draws: At each length of the shifts.
    """
    numbers = paper_numbers()
    bed = testbed(numbers)
    found = bed.closed_form(bed.image(bed.camera_from_light, bed.shift_m), bed.shift_m)
    raw = SE3(found.raw_rotation, found.camera_from_light.translation.copy())
    base = base_of_station(bed.eye_base_from_camera, raw, bed.hand_base_from_light)
    printed = {k: _pose(numbers["table1_camera_from_led"][k]) for k in _LEVELS}
    # The paper's Table 1 orthonormalised by its own iteration.
    table_2 = {k: SE3(orthonormalised(pose.rotation), pose.translation) for k, pose in printed.items()}
    table_3 = {k: base_of_station(bed.eye_base_from_camera, table_2[k], bed.hand_base_from_light) for k in _LEVELS}
    return {
        "noiseless": {"camera_from_led": _entry(raw), "eye_base_from_hand_base": _entry(base)},
        "table1_camera_from_led": {k: _table_1(bed, s, seed, draws, numbers, k) for k, s in _LEVELS.items()},
        "table2_orthonormalised": {k: table_2[k].rotation.tolist() for k in _LEVELS},
        "table3_eye_base_from_hand_base": {k: _entry(table_3[k]) for k in _LEVELS},
        "orders_of_orthonormalising": {k: _orders(bed, numbers, k) for k in _LEVELS},
        "shift_length": [_at_length(bed, length, seed, length_draws) for length in LENGTHS],
        "settings": {"seed": seed, "draws": draws, "length_draws": length_draws, "sigma_px": SIGMA_PX},
        "paper": numbers,
    }


def _pose(entry: dict[str, Any]) -> SE3:
    return SE3(np.array(entry["R"], dtype=np.float64), np.array(entry["t"], dtype=np.float64))


def _entry(transform: SE3) -> dict[str, Any]:
    return {"R": transform.rotation.tolist(), "t": transform.translation.tolist()}


def _table_1(bed: Testbed, level: float, seed: int, draws: int, numbers: dict[str, Any], key: str) -> dict[str, Any]:
    """Mean and spread of the estimates over draws of the noise, and where the paper's single draw lies in them."""
    exact = bed.image(bed.camera_from_light, bed.shift_m)
    noise = 1 + level * np.random.default_rng(seed).normal(size=(draws, *exact.shape))
    found = bed.closed_form(exact * noise, bed.shift_m)
    t = found.camera_from_light.translation
    printed = numbers["table1_camera_from_led"][key]
    off = np.concatenate([(np.array(printed["R"]) - found.raw_rotation.mean(0)).ravel(), printed["t"] - t.mean(0)])
    sd = np.concatenate([found.raw_rotation.std(0).ravel(), t.std(0)])
    # The fraction of draws that are nearer to the truth than the paper's, once orthonormal.
    true = bed.camera_from_light
    turn = _angle(found.camera_from_light.rotation, true.rotation)
    shift = np.linalg.norm(found.camera_from_light.translation - true.translation, axis=-1)
    printed_turn = _angle(nearest_rotation(np.array(printed["R"])), true.rotation)
    printed_shift = np.linalg.norm(np.array(printed["t"]) - true.translation)
    return {
        "R": found.raw_rotation.mean(0).tolist(),
        "t": t.mean(0).tolist(),
        "R_sd": found.raw_rotation.std(0).tolist(),
        "t_sd": t.std(0).tolist(),
        "paper_off_by_sigmas": {"R": (off / sd)[:9].reshape(3, 3).tolist(), "t": (off / sd)[9:].tolist()},
        "paper_quantile": {
            "rotation": float(np.mean(turn < printed_turn)),
            "translation": float(np.mean(shift < printed_shift)),
        },
    }


def _angle(first: Array, second: Array) -> Array:
    turned = nearest_rotation(np.swapaxes(first, -1, -2) @ second)
    return np.asarray(np.linalg.norm(rotation_log(turned), axis=-1))


def _orders(bed: Testbed, numbers: dict[str, Any], key: str) -> dict[str, float]:
    """Orthonormalising before composing and after: the rotations are equal, the translations are not."""
    t = np.array(numbers["table1_camera_from_led"][key]["t"])
    raw = np.array(numbers["table1_camera_from_led"][key]["R"])
    before = base_of_station(bed.eye_base_from_camera, SE3(nearest_rotation(raw), t), bed.hand_base_from_light)
    loose = base_of_station(bed.eye_base_from_camera, SE3(raw, t.copy()), bed.hand_base_from_light)
    true = bed.eye_base_from_hand_base.translation
    return {
        "rotations_differ_by": float(np.abs(nearest_rotation(loose.rotation) - before.rotation).max()),
        "translation_error_before": float(np.linalg.norm(before.translation - true)),
        "translation_error_after": float(np.linalg.norm(loose.translation - true)),
    }


def _at_length(bed: Testbed, shift_m: float, seed: int, draws: int) -> dict[str, float]:
    """Rms errors over draws of pixel noise at one length of the shifts, and the Cramer-Rao bound."""
    rotation = nearest_rotation(bed.camera_from_light.rotation)
    true = SE3(rotation, bed.camera_from_light.translation.copy())
    image = bed.image(true, shift_m)
    seen = image + SIGMA_PX * np.random.default_rng(seed).normal(size=(draws, *image.shape))
    closed = bed.closed_form(seen, shift_m).camera_from_light
    everywhere = np.ones(seen.shape[:2], dtype=bool)
    weight = everywhere / SIGMA_PX
    points = shift_m * shift_directions(two_sided=False)
    measurement = PixelMeasurement(points, seen, everywhere, weight, weight)
    camera = Camera("pinhole", np.array([*bed.focal_px, 0.0, 0.0]))
    likely = refined(measurement, closed, camera, iterations=100).camera_from_target
    at_truth = measurement.take(slice(0, 1)).linearise(SE3(true.rotation[None], true.translation[None]), camera, False)
    bound = np.diag(np.linalg.inv(at_truth.information[0]))
    return {
        "shift_m": shift_m,
        **_rms("closed_form", closed, true),
        **_rms("maximum_likelihood", likely, true),
        "bound_deg": float(np.degrees(np.sqrt(bound[3:].sum()))),
        "bound_mm": float(1e3 * np.sqrt(bound[:3].sum())),
    }


def _rms(name: str, found: SE3, true: SE3) -> dict[str, float]:
    turn = _angle(found.rotation, true.rotation)
    shift = np.linalg.norm(found.translation - true.translation, axis=-1)
    return {
        f"{name}_deg": float(np.degrees(np.sqrt(np.mean(turn**2)))),
        f"{name}_mm": float(1e3 * np.sqrt(np.mean(shift**2))),
    }
