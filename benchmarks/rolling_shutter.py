"""Whether answers from a rolling-shutter camera and moving arms are true.

Recordings are those of `benchmarks.clocks`, with line times of 10 to 30 us: each pixel shows its point when its own row
was read. The line time is stated exactly, stated with a prior of 20 % about a value drawn from it, or left out.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Cell, PixelObservation, Recording, RollingShutter, Sample
from basecal.geometry import SE3, Array
from basecal.simulation.layout import make_layout
from basecal.simulation.motion import draw_motions, points_in_camera, seen_points
from basecal.simulation.scenario import Scenario
from basecal.simulation.scene import Scene, draw_scene
from basecal.simulation.stated_cell import stated_cell, truth
from benchmarks.clocks import BASE, MOST_OFF_S, VIEWS, robot_records
from benchmarks.common import run_cells, table
from benchmarks.wrong_answers import NOISE, path_poses, two_arm_scenario

LINES_S = (1e-5, 3e-5)
PRIOR = 0.2  # of the line time
ALL = 60
FAR_QUANTILE = 0.999
HEAD = (
    "line time",
    "recordings",
    "NEES/6",
    "base error, median [mm]",
    "truth beyond 99.9 %",
    "of these good",
    "line time within 95 %",
)


class Outcome(NamedTuple):
    """Outcome of one recording with one statement: NEES and error of the base, and error of the line time in sigmas."""

    stated: str
    nees: float
    off_mm: float
    verdict: str
    line_sigmas: float


def simulate_recording(seed: int) -> tuple[Cell, Recording, dict[str, SE3], float]:
    """Poses at 50 Hz, views at 5 Hz by a rolling shutter, the true transforms, and the line time [s]."""
    scenario = two_arm_scenario(seed, samples=10, spread_rad=0.4)
    rng = np.random.default_rng(11000 + seed)
    line_s, offset_s = float(rng.uniform(*LINES_S)), float(rng.uniform(-MOST_OFF_S, MOST_OFF_S))
    scene_rng, motion_rng, noise_rng, prior_rng = np.random.default_rng(7000 + seed).spawn(4)
    scene = draw_scene(scenario, make_layout(scenario.layout), scene_rng)
    (path,) = draw_motions(scene, scenario, motion_rng, {})
    seen_s = 0.15 + 0.2 * np.arange(VIEWS)
    noise = {robot: SE3.exp(motion_rng.standard_normal((VIEWS, 6)) * np.repeat(NOISE, 3)) for robot in path.recorded}
    (view,) = scene.layout.groups[path.group]
    pixels = row_by_row(scene, scenario, path.recorded, noise, seen_s, line_s)
    pixels += scenario.pixel_px * noise_rng.standard_normal(pixels.shape)
    first_poses = {robot: path_poses(poses, seen_s) @ noise[robot] for robot, poses in path.recorded.items()}
    mask, ids = seen_points(scene, scenario, view, first_poses), scene.shapes[view[1]].ids
    views = [
        Sample(k, float(seen_s[k] - offset_s), observations=(PixelObservation(*view, ids[m], pixels[k][m]),))
        for k, m in enumerate(mask)
        if m.sum() >= 4
    ]
    cell = stated_cell(scene, scenario, prior_rng, {})
    return cell, Recording((*views, *robot_records(path.recorded))), dict(truth(scene, cell)), line_s


def row_by_row(
    scene: Scene, scenario: Scenario, paths: dict[str, SE3], noise: dict[str, SE3], seen_s: Array, line_s: float
) -> Array:
    """Pixels of every point, (n, p, 2), each at the time when its own row was read."""
    (view,) = scene.layout.groups[0]
    count = len(scene.shapes[view[1]].ids)
    view_index, point = np.repeat(np.arange(len(seen_s)), count), np.tile(np.arange(count), len(seen_s))
    rows = np.zeros(len(view_index))
    for _ in range(4):  # rows and instants in turn, which converges quickly since points move little during an image
        poses = {
            robot: path_poses(path, seen_s[view_index] + line_s * rows) @ noise[robot][view_index]
            for robot, path in paths.items()
        }
        pixels = scene.lenses[view[0]].project(points_in_camera(scene, view, poses)[np.arange(len(view_index)), point])
        rows = pixels[:, 1]
    return np.asarray(pixels.reshape(len(seen_s), count, 2))


def with_shutter(cell: Cell, shutter: RollingShutter | None) -> Cell:
    """The cell with this rolling shutter stated for all cameras."""
    return replace(cell, cameras={n: replace(c, rolling_shutter=shutter) for n, c in cell.cameras.items()})


def trials(seed: int) -> list[Outcome]:
    """Calibrate one recording, with its line time stated in each way."""
    cell, recording, truth, line_s = simulate_recording(seed)
    guess_s = line_s * (1 + PRIOR * float(np.random.default_rng(13000 + seed).standard_normal()))
    statements = {
        "fixed": RollingShutter("fixed", line_s),
        "prior of 20 %": RollingShutter("prior", guess_s, PRIOR * line_s),
        "left out": None,
    }
    out = []
    for name, shutter in statements.items():
        calibration = calibrate(with_shutter(cell, shutter), recording)
        nees, off_mm, sigmas = np.nan, np.nan, np.nan
        if BASE in calibration.transforms:
            xi = (calibration[BASE].mean.inverse() @ truth[BASE]).log()
            nees, off_mm = (
                float(xi @ np.linalg.solve(calibration[BASE].covariance, xi)),
                1e3 * float(np.linalg.norm(xi[:3])),
            )
        for line in calibration.line_times.values():
            sigmas = abs(line.line_time_s - line_s) / line.sigma_s if line.sigma_s else np.nan
        out.append(Outcome(name, nees, off_mm, calibration.verdict, sigmas))
    return out


def summary(outcomes: list[Outcome]) -> dict[str, Any]:
    """Statistics over recordings."""
    nees = np.array([f.nees for f in outcomes])
    wrong = nees > chi2.ppf(FAR_QUANTILE, 6)
    sigmas = np.array([f.line_sigmas for f in outcomes])
    within = None if np.isnan(sigmas).all() else float(np.mean(sigmas <= np.sqrt(chi2.ppf(0.95, 1))))
    return {
        "recordings": len(outcomes),
        "nees": float(np.nanmean(nees) / 6),
        "off_mm": float(np.nanmedian([f.off_mm for f in outcomes])),
        "wrong": float(np.mean(wrong)),
        "wrong_and_good": float(np.mean(wrong & np.array([f.verdict == "good" for f in outcomes]))),
        "good": float(np.mean([f.verdict == "good" for f in outcomes])),
        "line_within": within,
    }


def row(name: str, statistics: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    within = "" if statistics["line_within"] is None else f"{100 * statistics['line_within']:.1f} %"
    shares = (f"{100 * statistics['wrong']:.1f} %", f"{100 * statistics['wrong_and_good']:.1f} %", within)
    return (name, statistics["recordings"], f"{statistics['nees']:.3f}", f"{statistics['off_mm']:.2f}", *shares)


def make_result(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Statistics by how the line time was stated."""
    outcomes = [Outcome(**each) for each in rows]
    statements = list(dict.fromkeys(f.stated for f in outcomes))
    by_statement = {name: summary([f for f in outcomes if f.stated == name]) for name in statements}
    return {"rows": by_statement, "lines_s": LINES_S, "prior": PRIOR}


def format_table(rows: list[dict[str, Any]]) -> str:
    """The table of the statistics."""
    return table(HEAD, [row(name, statistics) for name, statistics in make_result(rows)["rows"].items()])


def main(arguments: list[str]) -> None:
    """Draw and print; with all recordings write results/rolling_shutter.json too."""
    run_cells(
        "rolling_shutter", arguments, ALL, lambda seed: [f._asdict() for f in trials(seed)], format_table, make_result
    )


if __name__ == "__main__":
    main(sys.argv[1:])
