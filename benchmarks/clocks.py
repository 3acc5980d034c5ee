"""Whether the offset of a camera's clock is found, with a sigma that is true, from arms that move.

Two arms move along smooth paths; their poses are recorded in lines of their own, the camera's views in others, whose
stamps are off by up to 50 ms. Noise of robots is stated in every second recording, and nothing else about clocks.
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
from benchmarks.common import cell_by_cell, table
from benchmarks.wrong_answers import NOISE, Drawn, _along, _scenario

BASE = "eye_base_from_hand_base"
MOST_OFF_S = 0.05
VIEWS = 60
LOW, HIGH = 0.92, 0.98  # of 500: 95 % less and more three standard errors of a share
NEES_LOW, NEES_HIGH = 0.9, 1.1
ALL = 500
HEAD = ("recordings", "noise of robots", "offset within 95 %", "median sigma [ms]", "rms error [ms]", "NEES/6", "good")


class Found(NamedTuple):
    """What became of one recording: error and sigma of the offset [s], NEES / 6 of the base, and the verdict."""

    stated: bool
    error_s: float
    sigma_s: float
    nees: float
    verdict: str
    codes: tuple[str, ...]
    seconds: float


def streams(seed: int) -> tuple[Drawn, float]:
    """Poses at 50 a second, views at five, and by how much the views' stamps have to be corrected [s]."""
    scenario = _scenario(seed, samples=10, spread_rad=0.4)
    offset_s = float(np.random.default_rng(9000 + seed).uniform(-MOST_OFF_S, MOST_OFF_S))
    scene_rng, motion_rng, noise_rng, prior_rng = np.random.default_rng(5000 + seed).spawn(4)
    scene = draw_scene(scenario, make_layout(scenario.layout), scene_rng)
    (way,) = draw_motions(scene, scenario, motion_rng, {})
    seen_s = 0.15 + 0.2 * np.arange(VIEWS)
    where = {robot: _along(poses, seen_s) for robot, poses in way.recorded.items()}
    noise = {robot: motion_rng.standard_normal((VIEWS, 6)) * np.repeat(NOISE, 3) for robot in where}
    motion = Motion(0, where, {robot: poses @ poses.exp(noise[robot]) for robot, poses in where.items()})
    views = observe(motion, scene, scenario, noise_rng)
    seen = [Sample(k, float(seen_s[k] - offset_s), observations=v) for k, v in enumerate(views) if len(v[0].ids) >= 4]
    cell = stated_cell(scene, scenario, prior_rng, {})
    return Drawn(cell, Recording((*seen, *told(way.recorded))), dict(truth(scene, cell))), offset_s


def told(ways: Mapping[str, SE3]) -> list[Sample]:
    """Records of robots along their ways at 50 a second, numbered after the views."""
    told_s = 0.02 * np.arange(620)
    paths = {robot: _along(poses, told_s) for robot, poses in ways.items()}
    return [
        Sample(VIEWS + k, float(told_s[k]), {robot: RobotState(poses[k]) for robot, poses in paths.items()})
        for k in range(len(told_s))
    ]


def one(seed: int) -> Found:
    """One recording, calibrated."""
    drawn, offset_s = streams(seed)
    began = time.perf_counter()
    found = calibrate(drawn.cell, drawn.recording)
    took = time.perf_counter() - began
    clock = next(iter(found.clocks.values()), None)
    nees = np.nan
    if BASE in found.transforms:
        xi = (found[BASE].mean.inverse() @ drawn.truth[BASE]).log()
        nees = float(xi @ np.linalg.solve(found[BASE].covariance, xi)) / 6
    error, sigma = (np.nan, np.nan) if clock is None else (clock.offset_s - offset_s, clock.sigma_s)
    codes = tuple(f.code for f in found.findings if f.severity != "info")
    return Found(seed % 2 == 0, error, sigma, nees, found.verdict, codes, took)


def summary(found: list[Found]) -> dict[str, Any]:
    """Shares over recordings."""
    error, sigma, nees = (np.array([getattr(f, name) for f in found]) for name in ("error_s", "sigma_s", "nees"))
    width = float(np.sqrt(chi2.ppf(0.95, 1)))
    return {
        "recordings": len(found),
        "within": float(np.mean(np.abs(error) <= width * sigma)),
        "median_sigma_s": float(np.nanmedian(sigma)),
        "rms_error_s": float(np.sqrt(np.nanmean(error**2))),
        "nees": float(np.nanmean(nees)),
        "good": float(np.mean([f.verdict == "good" for f in found])),
        "not_good": sorted({code for f in found for code in f.codes}),
        "median_seconds": float(np.median([f.seconds for f in found])),
    }


def row(name: str, of: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    shares = (f"{100 * of['within']:.1f} %", f"{1e3 * of['median_sigma_s']:.2f}", f"{1e3 * of['rms_error_s']:.2f}")
    return (of["recordings"], name, *shares, f"{of['nees']:.3f}", f"{100 * of['good']:.1f} %")


def result(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Shares over recordings as `one` has found them, of all, and by whether noise of robots was stated."""
    found = [Found(**each) for each in rows]
    parts = {"all": found, "stated": [f for f in found if f.stated], "estimated": [f for f in found if not f.stated]}
    return {"rows": {name: summary(part) for name, part in parts.items() if part}, "offset_s": MOST_OFF_S}


def shown(rows: list[dict[str, Any]]) -> str:
    """The table of them."""
    return table(HEAD, [row(name, of) for name, of in result(rows)["rows"].items()])


def main(arguments: list[str]) -> None:
    """Draw and print; of all recordings results/clocks.json too."""
    cell_by_cell("clocks", arguments, ALL, lambda seed: [one(seed)._asdict()], shown, result)


if __name__ == "__main__":
    main(sys.argv[1:])
