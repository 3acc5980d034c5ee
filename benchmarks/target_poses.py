"""Target poses by `solvePnP`, as easy_handeye and apriltag give them: verdicts and ellipsoids of clean recordings.

Command: python -m benchmarks.target_poses [--draws 60] [--samples 20].
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from scipy.stats import chi2

import basecal
from basecal.geometry import SE3, Array
from benchmarks.common import run_draws, table

DRAWS, SAMPLES = 60, 20
LENS = np.array([[900.0, 0, 640], [0, 900, 360], [0, 0, 1]])
PIXEL_PX = 0.2
TARGETS = {
    "a tag of 80 mm": 0.04 * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0.0]]),
    "5 x 5 corners 30 mm apart": 0.03 * np.array([[x, y, 0.0] for y in range(-2, 3) for x in range(-2, 3)]),
}


def random_views(rng: np.random.Generator, count: int) -> SE3:
    """camera_from_target from 0.35 to 0.8 m, tilted by up to 40 deg."""
    tilt, azimuth, roll = rng.uniform(0, 0.7, count), rng.uniform(0, 2 * np.pi, count), rng.normal(0, 0.5, count)
    tilted = SE3.from_rotvec(
        tilt[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], -1), np.zeros((count, 3))
    )
    rolled = SE3.from_rotvec(roll[:, None] * [0, 0, 1.0], np.zeros((count, 3)))
    facing = SE3.from_rotvec([np.pi, 0, 0], [0, 0, 0])
    places = np.c_[rng.normal(0, 0.07, count), rng.normal(0, 0.05, count), rng.uniform(0.35, 0.8, count)]
    return SE3((facing @ rolled @ tilted).rotation, places)


def pnp_pose(points_in_target: Array, pixels: Array) -> tuple[Array, Array]:
    """Refined rotation vector and translation of a target."""
    method = cv2.SOLVEPNP_IPPE_SQUARE if len(points_in_target) == 4 else cv2.SOLVEPNP_IPPE
    _, turn, place = cv2.solvePnP(points_in_target, pixels, LENS, None, flags=method)
    turn, place = cv2.solvePnPRefineLM(points_in_target, pixels, LENS, None, turn, place)
    return np.ravel(turn), np.ravel(place)


def trial(seed: int, samples: int, points_in_target: Array) -> dict[str, Any]:
    """Verdict, codes, error [m] of the mount, and its square in sigmas."""
    rng = np.random.default_rng(seed)
    mount = SE3.exp(np.r_[rng.normal(0, 0.05, 3), rng.normal(0, 0.5, 3)])
    base_from_target = SE3.exp(np.r_[rng.normal(0, 0.5, 3), rng.normal(0, 1, 3)])
    true = random_views(rng, samples)
    noise = SE3.exp(rng.normal(size=(samples, 6)) * np.repeat([1e-4, 2e-4], 3))
    gripper = base_from_target @ true.inverse() @ mount.inverse() @ noise
    target_poses = []
    for k in range(samples):
        points = true[k] @ points_in_target
        pixels = points[:, :2] / points[:, 2:] * 900.0 + [640, 360] + rng.normal(0, PIXEL_PX, (len(points), 2))
        target_poses.append(pnp_pose(points_in_target, pixels))
    turns, places = (np.array(part) for part in zip(*target_poses, strict=True))
    calibration = basecal.hand_eye(gripper.rotation, gripper.translation, turns, places)
    off = (calibration["cam2gripper"].mean.inverse() @ mount).log()
    square = float(off @ np.linalg.solve(calibration["cam2gripper"].covariance, off))
    codes = [each.code for each in calibration.findings if each.severity != "info"]
    return {"verdict": calibration.verdict, "codes": codes, "m": float(np.linalg.norm(off[:3])), "square": square}


def summary(name: str, trials: list[dict[str, Any]]) -> dict[str, Any]:
    """A row of the table."""
    squares = np.array([each["square"] for each in trials])
    return {
        "target": name,
        "not_good": sum(each["verdict"] != "good" for each in trials),
        "codes": sorted({code for each in trials for code in each["codes"]}),
        "rms_mm": 1e3 * float(np.sqrt(np.mean([each["m"] ** 2 for each in trials]))),
        "held": float(np.mean(squares < chi2.ppf(0.95, 6))),
        "mean_square": float(squares.mean() / 6),
    }


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows = [
        (row["target"], row["not_good"], f"{row['rms_mm']:.2f}", f"{row['held']:.1%}", f"{row['mean_square']:.2f}")
        for row in result["rows"]
    ]
    head = ("target", "not good", "rms [mm]", "95 % ellipsoid holds", "NEES/6")
    about = f"""\
A hand-eye calibration from {result["samples"]} target poses, which PnP estimates from noisy corners. There are
{result["draws"]} draws of each target."""
    return f"{about}\n\n{table(head, rows)}"


def measure(draws: int, samples: int) -> dict[str, Any]:
    """A row for each target."""
    trials = {name: [trial(seed, samples, points) for seed in range(draws)] for name, points in TARGETS.items()}
    return {"rows": [summary(name, trials_of_target) for name, trials_of_target in trials.items()]}


def format_table(result: Mapping[str, Any]) -> str:
    """All rows as a table."""
    return table(list(result["rows"][0]), [list(row.values()) for row in result["rows"]])


if __name__ == "__main__":
    run_draws("target_poses", sys.argv[1:], (DRAWS, SAMPLES), measure, format_table)
