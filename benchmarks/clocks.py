"""Whether the offset of a camera's clock is estimated with a true sigma, from moving arms.

Two arms move along smooth paths. Poses and views are separate lines of the recording. The stamps of the views are off
by up to 50 ms. Noise of robots is stated in every second recording, and nothing is stated about clocks.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Recording, RobotState, Sample
from basecal.geometry import SE3
from basecal.simulation.layout import make_layout
from basecal.simulation.motion import Motion, draw_motions
from basecal.simulation.scene import draw_scene
from basecal.simulation.stated_cell import stated_cell, truth
from basecal.simulation.testbed import observe
from benchmarks.common import run_cells, table
from benchmarks.wrong_answers import NOISE, Drawn, path_poses, two_arm_scenario

BASE = "eye_base_from_hand_base"
MOST_OFF_S = 0.05
VIEWS = 60
LOW, HIGH = 0.92, 0.98  # limits of a share of 500: 95 % minus and plus three standard errors
NEES_LOW, NEES_HIGH = 0.9, 1.1
ALL = 500
HEAD = ("recordings", "noise of robots", "offset within 95 %", "median sigma [ms]", "rms error [ms]", "NEES/6", "good")


class Outcome(NamedTuple):
    """Outcome of one recording: error and sigma of the offset [s], NEES / 6 of the base, and the verdict."""

    stated: bool
    error_s: float
    sigma_s: float
    nees: float
    verdict: str
    codes: tuple[str, ...]
    seconds: float


def streams(seed: int) -> tuple[Drawn, float]:
    """Poses at 50 Hz and views at 5 Hz, and the correction of the views' stamps [s]."""
    scenario = two_arm_scenario(seed, samples=10, spread_rad=0.4)
    offset_s = float(np.random.default_rng(9000 + seed).uniform(-MOST_OFF_S, MOST_OFF_S))
    scene_rng, motion_rng, noise_rng, prior_rng = np.random.default_rng(5000 + seed).spawn(4)
    scene = draw_scene(scenario, make_layout(scenario.layout), scene_rng)
    (path,) = draw_motions(scene, scenario, motion_rng, {})
    seen_s = 0.15 + 0.2 * np.arange(VIEWS)
    true_poses = {robot: path_poses(poses, seen_s) for robot, poses in path.recorded.items()}
    noise = {robot: motion_rng.standard_normal((VIEWS, 6)) * np.repeat(NOISE, 3) for robot in true_poses}
    motion = Motion(0, true_poses, {robot: poses @ poses.exp(noise[robot]) for robot, poses in true_poses.items()})
    views = observe(motion, scene, scenario, noise_rng)
    seen = [Sample(k, float(seen_s[k] - offset_s), observations=v) for k, v in enumerate(views) if len(v[0].ids) >= 4]
    cell = stated_cell(scene, scenario, prior_rng, {})
    return Drawn(cell, Recording((*seen, *robot_records(path.recorded))), dict(truth(scene, cell))), offset_s


def robot_records(paths: Mapping[str, SE3]) -> list[Sample]:
    """Samples of the robots along their paths at 50 Hz, numbered after the views."""
    stamps_s = 0.02 * np.arange(620)
    poses_at = {robot: path_poses(poses, stamps_s) for robot, poses in paths.items()}
    return [
        Sample(VIEWS + k, float(stamps_s[k]), {robot: RobotState(poses[k]) for robot, poses in poses_at.items()})
        for k in range(len(stamps_s))
    ]


def trial(seed: int) -> Outcome:
    """Calibrate one recording."""
    drawn, offset_s = streams(seed)
    began = time.perf_counter()
    calibration = calibrate(drawn.cell, drawn.recording)
    took = time.perf_counter() - began
    clock = next(iter(calibration.clocks.values()), None)
    nees = np.nan
    if BASE in calibration.transforms:
        xi = (calibration[BASE].mean.inverse() @ drawn.truth[BASE]).log()
        nees = float(xi @ np.linalg.solve(calibration[BASE].covariance, xi)) / 6
    error, sigma = (np.nan, np.nan) if clock is None else (clock.offset_s - offset_s, clock.sigma_s)
    codes = tuple(f.code for f in calibration.findings if f.severity != "info")
    return Outcome(seed % 2 == 0, error, sigma, nees, calibration.verdict, codes, took)


def summary(outcomes: list[Outcome]) -> dict[str, Any]:
    """Statistics over recordings."""
    error, sigma, nees = (np.array([getattr(f, name) for f in outcomes]) for name in ("error_s", "sigma_s", "nees"))
    width = float(np.sqrt(chi2.ppf(0.95, 1)))
    return {
        "recordings": len(outcomes),
        "within": float(np.mean(np.abs(error) <= width * sigma)),
        "median_sigma_s": float(np.nanmedian(sigma)),
        "rms_error_s": float(np.sqrt(np.nanmean(error**2))),
        "nees": float(np.nanmean(nees)),
        "good": float(np.mean([f.verdict == "good" for f in outcomes])),
        "not_good": sorted({code for f in outcomes for code in f.codes}),
        "median_seconds": float(np.median([f.seconds for f in outcomes])),
    }


def row(name: str, statistics: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    shares = (
        f"{100 * statistics['within']:.1f} %",
        f"{1e3 * statistics['median_sigma_s']:.2f}",
        f"{1e3 * statistics['rms_error_s']:.2f}",
    )
    return (statistics["recordings"], name, *shares, f"{statistics['nees']:.3f}", f"{100 * statistics['good']:.1f} %")


def make_result(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Statistics of all recordings, and by whether noise of robots was stated."""
    outcomes = [Outcome(**each) for each in rows]
    parts = {
        "all": outcomes,
        "stated": [f for f in outcomes if f.stated],
        "estimated": [f for f in outcomes if not f.stated],
    }
    return {"rows": {name: summary(part) for name, part in parts.items() if part}, "offset_s": MOST_OFF_S}


def format_table(rows: list[dict[str, Any]]) -> str:
    """The table of the statistics."""
    return table(HEAD, [row(name, statistics) for name, statistics in make_result(rows)["rows"].items()])


def main(arguments: list[str]) -> None:
    """Draw and print; with all recordings write results/clocks.json too."""
    run_cells("clocks", arguments, ALL, lambda seed: [trial(seed)._asdict()], format_table, make_result)


if __name__ == "__main__":
    main(sys.argv[1:])
