"""Comparison with the paper's simulations: tables, noise, order of orthonormalisation, and length of the shifts.

Source: "Base Calibration for Dual Robot System", section 4. The noise is interpreted as multiplicative and Gaussian on
each image coordinate of the LED about the principal point. Of the tested interpretations, only this one explains
Table 1. Its size, its seed and the number of draws are stated in `paper.yaml`, an ordinary study.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from basecal.estimation.axis_shift.closed_form import (
    base_of_station,
    orthonormalise,
)
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.view_pose import refine_poses
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.rotation import nearest_rotation, rotation_log
from basecal.simulation.shifts import shift_directions
from basecal.studies.paper_cell import Testbed, paper_cell, paper_numbers, printed_pose
from basecal.studies.study import Study
from basecal.studies.study_file import study_from_text

SHIFT_LENGTHS_M = (0.01, 0.02, 0.03, 0.06, 0.1, 0.2, 0.3, 0.6)
LENGTH_DRAWS = 5_000
SIGMA_PX = 0.1


@cache
def paper_study() -> Study:
    """The study of the paper's noise."""
    return study_from_text(files("basecal.studies").joinpath("paper.yaml").read_text("utf-8"), "paper.yaml")


def study_paper(seed: int | None = None, draws: int | None = None, length_draws: int = LENGTH_DRAWS) -> dict[str, Any]:
    """Repeat all simulations of the paper; our results have the paper's keys, and `paper` has the printed results.

    Args:
        seed: Seed of the noise; None for that of the study.
        draws: Number of draws of the noise; None for that of the study.
        length_draws: Number of draws at each length of the shifts.
    """
    study = paper_study()
    seed, draws = study.seed if seed is None else seed, study.trials if draws is None else draws
    levels = {f"{share:.0%}": share for share in study.axes["image_noise"]}
    numbers = paper_numbers()
    bed = paper_cell(numbers)
    closed_form = bed.closed_form(bed.image(bed.camera_from_led, bed.shift_m), bed.shift_m)
    raw = SE3(closed_form.raw_rotation, closed_form.camera_from_led.translation.copy())
    base = base_of_station(bed.eye_base_from_camera, raw, bed.hand_base_from_led)
    printed = {k: printed_pose(numbers["table1_camera_from_led"][k]) for k in levels}
    # The paper's Table 1, orthonormalised with the paper's iteration.
    table_2 = {k: SE3(orthonormalise(pose.rotation), pose.translation) for k, pose in printed.items()}
    table_3 = {k: base_of_station(bed.eye_base_from_camera, table_2[k], bed.hand_base_from_led) for k in levels}
    return {
        "noiseless": {"camera_from_led": _entry(raw), "eye_base_from_hand_base": _entry(base)},
        "table1_camera_from_led": {k: _table_1(bed, s, seed, draws, numbers, k) for k, s in levels.items()},
        "table2_orthonormalised": {k: table_2[k].rotation.tolist() for k in levels},
        "table3_eye_base_from_hand_base": {k: _entry(table_3[k]) for k in levels},
        "orders_of_orthonormalising": {k: _orders(bed, numbers, k) for k in levels},
        "shift_length": [_length_errors(bed, length, seed, length_draws) for length in SHIFT_LENGTHS_M],
        "settings": {"seed": seed, "draws": draws, "length_draws": length_draws, "sigma_px": SIGMA_PX},
        "paper": numbers,
    }


def _entry(transform: SE3) -> dict[str, Any]:
    return {"R": transform.rotation.tolist(), "t": transform.translation.tolist()}


def _table_1(bed: Testbed, level: float, seed: int, draws: int, numbers: dict[str, Any], key: str) -> dict[str, Any]:
    """Mean and standard deviation of estimates over draws of the noise, and the quantile of the paper's single draw."""
    exact = bed.image(bed.camera_from_led, bed.shift_m)
    noise = 1 + level * np.random.default_rng(seed).normal(size=(draws, *exact.shape))
    estimates = bed.closed_form(exact * noise, bed.shift_m)
    t = estimates.camera_from_led.translation
    printed = numbers["table1_camera_from_led"][key]
    difference = np.concatenate(
        [(np.array(printed["R"]) - estimates.raw_rotation.mean(0)).ravel(), printed["t"] - t.mean(0)]
    )
    sd = np.concatenate([estimates.raw_rotation.std(0).ravel(), t.std(0)])
    # The fraction of draws that are nearer to the truth than the paper's orthonormalised draw.
    true = bed.camera_from_led
    rotation_error = _angle(estimates.camera_from_led.rotation, true.rotation)
    translation_error = np.linalg.norm(estimates.camera_from_led.translation - true.translation, axis=-1)
    printed_rotation_error = _angle(nearest_rotation(np.array(printed["R"])), true.rotation)
    printed_translation_error = np.linalg.norm(np.array(printed["t"]) - true.translation)
    return {
        "R": estimates.raw_rotation.mean(0).tolist(),
        "t": t.mean(0).tolist(),
        "R_sd": estimates.raw_rotation.std(0).tolist(),
        "t_sd": t.std(0).tolist(),
        "paper_off_by_sigmas": {"R": (difference / sd)[:9].reshape(3, 3).tolist(), "t": (difference / sd)[9:].tolist()},
        "paper_quantile": {
            "rotation": float(np.mean(rotation_error < printed_rotation_error)),
            "translation": float(np.mean(translation_error < printed_translation_error)),
        },
    }


def _angle(first: Array, second: Array) -> Array:
    difference = nearest_rotation(first.mT @ second)
    return np.asarray(np.linalg.norm(rotation_log(difference), axis=-1))


def _orders(bed: Testbed, numbers: dict[str, Any], key: str) -> dict[str, float]:
    """Compare orthonormalisation before and after composition: rotations are equal, translations are not."""
    t = np.array(numbers["table1_camera_from_led"][key]["t"])
    raw = np.array(numbers["table1_camera_from_led"][key]["R"])
    before = base_of_station(bed.eye_base_from_camera, SE3(nearest_rotation(raw), t), bed.hand_base_from_led)
    after = base_of_station(bed.eye_base_from_camera, SE3.adopt(raw, t.copy()), bed.hand_base_from_led)
    true = bed.eye_base_from_hand_base.translation
    return {
        "rotations_differ_by": float(np.abs(nearest_rotation(after.rotation) - before.rotation).max()),
        "translation_error_before": float(np.linalg.norm(before.translation - true)),
        "translation_error_after": float(np.linalg.norm(after.translation - true)),
    }


def _length_errors(bed: Testbed, shift_m: float, seed: int, draws: int) -> dict[str, float]:
    """RMS errors over draws of pixel noise at one length of the shifts, and the Cramer-Rao bound."""
    rotation = nearest_rotation(bed.camera_from_led.rotation)
    true = SE3(rotation, bed.camera_from_led.translation.copy())
    image = bed.image(true, shift_m)
    seen = image + SIGMA_PX * np.random.default_rng(seed).normal(size=(draws, *image.shape))
    closed = bed.closed_form(seen, shift_m).camera_from_led
    is_visible = np.ones(seen.shape[:2], dtype=bool)
    weight = is_visible / SIGMA_PX
    points = shift_m * shift_directions(is_two_sided=False)
    measurement = PixelMeasurement(points, seen, is_visible, weight, weight)
    camera = Camera("pinhole", np.array([*bed.focal_px, 0.0, 0.0]))
    likely = refine_poses(measurement, closed, camera, iterations=100).camera_from_target
    at_truth = measurement.take(slice(0, 1)).linearise(SE3(true.rotation[None], true.translation[None]), camera, False)
    bound = np.diag(np.linalg.inv(at_truth.information[0]))
    return {
        "shift_m": shift_m,
        **_rms("closed_form", closed, true),
        **_rms("maximum_likelihood", likely, true),
        "bound_deg": float(np.degrees(np.sqrt(bound[3:].sum()))),
        "bound_mm": float(1e3 * np.sqrt(bound[:3].sum())),
    }


def _rms(name: str, solution: SE3, true: SE3) -> dict[str, float]:
    rotation_error = _angle(solution.rotation, true.rotation)
    translation_error = np.linalg.norm(solution.translation - true.translation, axis=-1)
    return {
        f"{name}_deg": float(np.degrees(np.sqrt(np.mean(rotation_error**2)))),
        f"{name}_mm": float(1e3 * np.sqrt(np.mean(translation_error**2))),
    }
