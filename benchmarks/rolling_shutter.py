"""Whether a camera whose rows are seen one after another is calibrated truly from arms that move.

As `benchmarks.clocks`, with rows of 10 to 30 us: each pixel is where its point was when its own row was read. The line
time is stated exactly; as a prior of 20 % about a value that is drawn from it; and left out.
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
from benchmarks.wrong_answers import NOISE, _along, _scenario

LINES_S = (1e-5, 3e-5)
PRIOR = 0.2  # of the line time
ALL = 60
BEYOND = 0.999
HEAD = (
    "line time",
    "recordings",
    "NEES/6",
    "base error, median [mm]",
    "truth beyond 99.9 %",
    "of these good",
    "line time within 95 %",
)


class Found(NamedTuple):
    """What became of one recording stated in one way: NEES and error of the base, and of the line time in sigmas."""

    stated: str
    nees: float
    off_mm: float
    verdict: str
    line_sigmas: float


def recorded(seed: int) -> tuple[Cell, Recording, dict[str, SE3], float]:
    """Poses at 50 a second, views at five with rows one after another, and the line time [s]."""
    scenario = _scenario(seed, samples=10, spread_rad=0.4)
    drawn = np.random.default_rng(11000 + seed)
    line_s, offset_s = float(drawn.uniform(*LINES_S)), float(drawn.uniform(-MOST_OFF_S, MOST_OFF_S))
    scene_rng, motion_rng, noise_rng, prior_rng = np.random.default_rng(7000 + seed).spawn(4)
    scene = draw_scene(scenario, make_layout(scenario.layout), scene_rng)
    (way,) = draw_motions(scene, scenario, motion_rng, {})
    seen_s = 0.15 + 0.2 * np.arange(VIEWS)
    noise = {robot: SE3.exp(motion_rng.standard_normal((VIEWS, 6)) * np.repeat(NOISE, 3)) for robot in way.recorded}
    (view,) = scene.layout.groups[way.group]
    pixels = row_by_row(scene, scenario, way.recorded, noise, seen_s, line_s)
    pixels += scenario.pixel_px * noise_rng.standard_normal(pixels.shape)
    at_first = {robot: _along(poses, seen_s) @ noise[robot] for robot, poses in way.recorded.items()}
    mask, ids = seen_points(scene, scenario, view, at_first), scene.shapes[view[1]].ids
    seen = [
        Sample(k, float(seen_s[k] - offset_s), observations=(PixelObservation(*view, ids[m], pixels[k][m]),))
        for k, m in enumerate(mask)
        if m.sum() >= 4
    ]
    cell = stated_cell(scene, scenario, prior_rng, {})
    return cell, Recording((*seen, *robot_records(way.recorded))), dict(truth(scene, cell)), line_s


def row_by_row(
    scene: Scene, scenario: Scenario, ways: dict[str, SE3], noise: dict[str, SE3], seen_s: Array, line_s: float
) -> Array:
    """Pixels of every point, (n, p, 2), each where it was when its own row was read."""
    (view,) = scene.layout.groups[0]
    count = len(scene.shapes[view[1]].ids)
    which, point = np.repeat(np.arange(len(seen_s)), count), np.tile(np.arange(count), len(seen_s))
    rows = np.zeros(len(which))
    for _ in range(4):  # rows and instants in turn: each round gains the share of an image that a point moves in
        there = {robot: _along(way, seen_s[which] + line_s * rows) @ noise[robot][which] for robot, way in ways.items()}
        pixels = scene.lenses[view[0]].project(points_in_camera(scene, view, there)[np.arange(len(which)), point])
        rows = pixels[:, 1]
    return np.asarray(pixels.reshape(len(seen_s), count, 2))


def stated(cell: Cell, shutter: RollingShutter | None) -> Cell:
    """The cell with what is known of the shutter of all its cameras."""
    return replace(cell, cameras={n: replace(c, rolling_shutter=shutter) for n, c in cell.cameras.items()})


def one(seed: int) -> list[Found]:
    """One recording, with its line time stated in each way."""
    cell, recording, true, line_s = recorded(seed)
    guess_s = line_s * (1 + PRIOR * float(np.random.default_rng(13000 + seed).standard_normal()))
    ways = {
        "fixed": RollingShutter("fixed", line_s),
        "prior of 20 %": RollingShutter("prior", guess_s, PRIOR * line_s),
        "left out": None,
    }
    out = []
    for name, shutter in ways.items():
        found = calibrate(stated(cell, shutter), recording)
        nees, off_mm, sigmas = np.nan, np.nan, np.nan
        if BASE in found.transforms:
            xi = (found[BASE].mean.inverse() @ true[BASE]).log()
            nees, off_mm = float(xi @ np.linalg.solve(found[BASE].covariance, xi)), 1e3 * float(np.linalg.norm(xi[:3]))
        for line in found.line_times.values():
            sigmas = abs(line.line_time_s - line_s) / line.sigma_s if line.sigma_s else np.nan
        out.append(Found(name, nees, off_mm, found.verdict, sigmas))
    return out


def summary(found: list[Found]) -> dict[str, Any]:
    """Shares over recordings."""
    nees = np.array([f.nees for f in found])
    wrong = nees > chi2.ppf(BEYOND, 6)
    sigmas = np.array([f.line_sigmas for f in found])
    within = None if np.isnan(sigmas).all() else float(np.mean(sigmas <= np.sqrt(chi2.ppf(0.95, 1))))
    return {
        "recordings": len(found),
        "nees": float(np.nanmean(nees) / 6),
        "off_mm": float(np.nanmedian([f.off_mm for f in found])),
        "wrong": float(np.mean(wrong)),
        "wrong_and_good": float(np.mean(wrong & np.array([f.verdict == "good" for f in found]))),
        "good": float(np.mean([f.verdict == "good" for f in found])),
        "line_within": within,
    }


def row(name: str, of: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    within = "" if of["line_within"] is None else f"{100 * of['line_within']:.1f} %"
    shares = (f"{100 * of['wrong']:.1f} %", f"{100 * of['wrong_and_good']:.1f} %", within)
    return (name, of["recordings"], f"{of['nees']:.3f}", f"{of['off_mm']:.2f}", *shares)


def result(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Shares over recordings as `one` has found them, by how the line time was stated."""
    found = [Found(**each) for each in rows]
    ways = list(dict.fromkeys(f.stated for f in found))
    of_ways = {name: summary([f for f in found if f.stated == name]) for name in ways}
    return {"rows": of_ways, "lines_s": LINES_S, "prior": PRIOR}


def shown(rows: list[dict[str, Any]]) -> str:
    """The table of them."""
    return table(HEAD, [row(name, of) for name, of in result(rows)["rows"].items()])


def main(arguments: list[str]) -> None:
    """Draw and print; of all recordings results/rolling_shutter.json too."""
    run_cells("rolling_shutter", arguments, ALL, lambda seed: [f._asdict() for f in one(seed)], shown, result)


if __name__ == "__main__":
    main(sys.argv[1:])
