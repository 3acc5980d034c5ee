"""`basecal` on noisy arrays of poses, compared with OpenCV's seven methods, and how well its covariance holds.

Command: python -m benchmarks.arrays [--draws 200] [--samples 20].
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2

import basecal
from basecal.accuracy.arrays.array_calibration import ArrayCalibration
from basecal.cell import Recording
from basecal.geometry import SE3
from basecal.vision.robot_world import METHODS, robot_world
from benchmarks.common import run_draws, table

DRAWS, SAMPLES = 200, 20
HOLD = 0.95
MOST_OF_BEST = 0.85


class Noise(NamedTuple):
    """Sigmas per axis of a robot's poses and of a camera's [m, rad]; by default an accurate arm and marker poses."""

    robot: tuple[float, float] = (2e-4, 3e-4)
    camera: tuple[float, float] = (1e-3, 4e-3)


class Draw(NamedTuple):
    """Recorded poses, and the truth."""

    base_from_gripper: SE3
    cam_from_target: SE3
    gripper_from_cam: SE3


def draw(seed: int, samples: int, noise: Noise) -> Draw:
    """Draw noisy poses of an arm that looks at a target from about half a metre."""
    rng = np.random.default_rng(seed)
    gripper_from_cam = SE3.exp(np.r_[rng.normal(0, 0.05, 3), rng.normal(0, 0.5, 3)])
    base_from_target = SE3.exp(np.r_[rng.normal(0, 0.5, 3), rng.normal(0, 1, 3)])
    places = np.c_[rng.normal(0, 0.1, (samples, 2)), rng.normal(0.5, 0.1, samples)]
    cam_from_target = SE3.exp(np.c_[places, rng.normal(0, 0.35, (samples, 3))])
    base_from_gripper = base_from_target @ cam_from_target.inverse() @ gripper_from_cam.inverse()
    recorded = [
        pose @ SE3.exp(rng.normal(size=(samples, 6)) * np.repeat(sigma, 3))
        for pose, sigma in ((base_from_gripper, noise.robot), (cam_from_target, noise.camera))
    ]
    return Draw(recorded[0], recorded[1], gripper_from_cam)


def trial(seed: int, samples: int, noise: Noise) -> dict[str, Any]:
    """Errors [m, rad] by method, our verdict, and our squared errors in sigmas, with noise unstated and stated."""
    poses = draw(seed, samples, noise)
    robot, seen = poses.base_from_gripper, poses.cam_from_target
    calibration = basecal.hand_eye(robot.rotation, robot.translation, seen.rotation, seen.translation)
    off = (calibration["cam2gripper"].mean.inverse() @ poses.gripper_from_cam).log()
    errors = {"basecal": off}
    for method in METHODS:
        theirs = robot_world(seen, robot.inverse(), method)
        errors[method] = np.full(6, np.nan) if theirs is None else (theirs.first @ poses.gripper_from_cam).log()
    square = float(off @ np.linalg.solve(calibration["cam2gripper"].covariance, off))
    stated = stated_squared_error(calibration, poses.gripper_from_cam, noise)
    codes = [each.code for each in calibration.findings if each.severity != "info"]
    return {"errors": errors, "square": square, "stated": stated, "verdict": calibration.verdict, "codes": codes}


def stated_squared_error(calibration: ArrayCalibration, gripper_from_cam: SE3, noise: Noise) -> float:
    """The squared error in sigmas if the cell states the noise of arm and camera as total."""
    arm = replace(calibration.cell.robots["eye"], noise=np.repeat(noise.robot, 3), is_total_noise=True)
    samples = [
        replace(sample, observations=tuple(replace(o, sigma=np.repeat(noise.camera, 3)) for o in sample.observations))
        for sample in calibration.recording.samples
    ]
    estimate = basecal.calibrate(replace(calibration.cell, robots={"eye": arm}), Recording(tuple(samples)))[
        "eye_flange_from_camera"
    ]
    off = (estimate.mean.inverse() @ gripper_from_cam).log()
    return float(off @ np.linalg.solve(estimate.covariance, off))


def summary(trials: list[dict[str, Any]]) -> dict[str, Any]:
    """Rms of lengths [m] and angles [rad] by name, share of errors within the 95 % ellipsoid, and verdicts."""
    rms = {}
    for name in trials[0]["errors"]:
        squares = np.square([each["errors"][name] for each in trials])
        rms[name] = [float(np.sqrt(np.mean(half.sum(1)))) for half in (squares[:, :3], squares[:, 3:])]
    best = [min(value[k] for name, value in rms.items() if name != "basecal") for k in range(2)]
    squares, stated = (np.array([each[key] for each in trials]) for key in ("square", "stated"))
    return {
        "rms": rms,
        "of_best": [rms["basecal"][k] / best[k] for k in range(2)],
        "held": float(np.mean(squares < chi2.ppf(HOLD, 6))),
        "mean_square": float(np.mean(squares) / 6),
        "held_stated": float(np.mean(stated < chi2.ppf(HOLD, 6))),
        "mean_square_stated": float(np.mean(stated) / 6),
        "not_good": [each["codes"] for each in trials if each["verdict"] != "good"],
    }


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows = [(name, f"{1e3 * m:.2f}", f"{1e3 * rad:.2f}") for name, (m, rad) in result["rms"].items()]
    length, angle = result["of_best"]
    about = f"""\
`basecal.hand_eye` on {result["draws"]} draws of {result["samples"]} pairs of poses with noise, compared with OpenCV's
methods. Its rms is {length:.2f} times that of the best of them in length, and {angle:.2f} times in angle. The 95 %
ellipsoid contains {result["held"]:.1%} of the errors. It allows for smooth errors of an arm whose noise is unstated,
and for mounts that bend ([measured](decisions/gravity_in_every_answer.md)). These arms have neither. With the noise of
arm and camera stated as `total` it contains {result["held_stated"]:.1%}.
Answers that are not good: {len(result["not_good"])}."""
    return f"{about}\n\n{table(('method', 'rms [mm]', '[mrad]'), rows)}"


def measure(draws: int, samples: int) -> dict[str, Any]:
    """Noise and summary of a number of draws."""
    return {"noise": Noise()._asdict(), **summary([trial(seed, samples, Noise()) for seed in range(draws)])}


def format_result(result: Mapping[str, Any]) -> str:
    """A table of the methods' rms errors, and the other numbers as text."""
    rows = [(name, f"{1e3 * m:.3f}", f"{1e3 * rad:.3f}") for name, (m, rad) in result["rms"].items()]
    rest = {key: value for key, value in result.items() if key != "rms"}
    return f"{table(('method', 'rms mm', 'rms mrad'), rows)}\n{rest}"


if __name__ == "__main__":
    run_draws("arrays", sys.argv[1:], (DRAWS, SAMPLES), measure, format_result)
