"""Whether covariances are true with few rendered images: nothing is stated, and robots have usual noise.

Each cell has two arms, the camera on one and a ChArUco board on the other, with both mounts unknown. Its 24 images are
rendered and detected, and a random subset is kept. NEES is the squared Mahalanobis distance of the base from the truth.
From ten images on, its mean over six degrees of freedom must be in a band. With fewer images, the 95 % ellipsoid must
hold the truth often enough.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Recording
from basecal.simulation import Scenario, SimulatedCell, simulate
from basecal.simulation.images import render_recording
from basecal.vision.detect import detect
from benchmarks.common import on_one_core, table, write

BASE = "eye_base_from_hand_base"
IMAGES = (3, 4, 5, 6, 7, 8, 10, 12, 16, 20, 24)
NOISE = (1e-4, 2e-4)  # [m, rad] per axis and stop
_SCENARIO = Scenario(samples=max(IMAGES), robot_noise=NOISE, state_robot_noise=False, state_pixel_noise=False)
FEWEST_FOR_BAND = 10
# The mean NEES / 6 of 40 cells has a standard deviation of 0.09; its upper tail is longer.
BAND = (0.7, 1.4)
HELD, LEAST_HELD = 0.95, 35 / 40
FAR_QUANTILE = 0.999
HEAD = ("images", "cells", "refused", "doubtful", "good", "NEES/6, mean", "median", "within 95 %",
        "good beyond 99.9 %", "translation, rms [mm]", "rotation, rms [mrad]", "findings", "holds")  # fmt: skip


class Outcome(NamedTuple):
    """One cell with some of its images; errors are NaN if there is no base."""

    verdict: str
    nees: float
    shift_m: float
    turn_rad: float
    codes: list[str]


def photograph_cell(seed: int) -> tuple[SimulatedCell, Recording]:
    """A cell and the detections of its rendered images."""
    simulated = simulate(_SCENARIO, seed)
    with tempfile.TemporaryDirectory() as folder:
        return simulated, detect(simulated.cell, render_recording(simulated, Path(folder), seed=1000 * seed))


def outcomes(seed: int, counts: Sequence[int]) -> list[Outcome]:
    """Outcomes of a cell by the number of its images, the first of a random order."""
    simulated, recording = photograph_cell(seed)
    order = np.random.default_rng([seed, 1]).permutation(len(recording.samples))
    return [_outcome(simulated, recording, np.sort(order[:count]).tolist()) for count in counts]


def _outcome(simulated: SimulatedCell, recording: Recording, rows: list[int]) -> Outcome:
    few = tuple(replace(recording.samples[k], images={}) for k in rows)
    calibration = calibrate(simulated.cell, replace(recording, samples=few))
    codes = [f.code for f in calibration.findings if f.severity != "info"]
    if BASE not in calibration.transforms:
        return Outcome("refused", np.nan, np.nan, np.nan, codes)
    xi = (calibration[BASE].mean.inverse() @ simulated.truth[BASE]).log()
    nees = float(xi @ np.linalg.solve(calibration[BASE].covariance, xi))
    return Outcome(calibration.verdict, nees, float(np.linalg.norm(xi[:3])), float(np.linalg.norm(xi[3:])), codes)


def summary(count: int, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Statistics of all cells with a number of images."""
    given = [o for o in outcomes if not np.isnan(o.nees)]
    nees = np.array([o.nees for o in given]) / 6
    limit = chi2.ppf(HELD, 6) / 6
    shift, turn = ([getattr(o, name) for o in given] for name in ("shift_m", "turn_rad"))
    return {
        "pictures": count,
        "cells": len(outcomes),
        **{verdict: sum(o.verdict == verdict for o in outcomes) for verdict in ("refused", "doubtful", "good")},
        "mean": float(nees.mean()) if given else None,
        "median": float(np.median(nees)) if given else None,
        "within": int((nees <= limit).sum()),
        "good_beyond": sum(o.verdict == "good" and bool(o.nees > chi2.ppf(FAR_QUANTILE, 6)) for o in given),
        "shift_mm": 1e3 * float(np.sqrt(np.mean(np.square(shift)))) if given else None,
        "turn_mrad": 1e3 * float(np.sqrt(np.mean(np.square(turn)))) if given else None,
        "codes": dict(Counter(code for o in outcomes for code in set(o.codes)).most_common()),
    }


def holds(result: dict[str, Any]) -> bool:
    """Whether a row meets its requirement."""
    if result["pictures"] >= FEWEST_FOR_BAND:
        return result["mean"] is not None and bool(BAND[0] <= result["mean"] <= BAND[1])
    return bool(result["within"] + result["refused"] >= LEAST_HELD * result["cells"])


def row(result: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    first = tuple(result[k] for k in ("pictures", "cells", "refused", "doubtful", "good"))
    mean, median, shift, turn = (
        "" if result[k] is None else f"{result[k]:.2f}" for k in ("mean", "median", "shift_mm", "turn_mrad")
    )
    codes = ", ".join(f"{code} {count}" for code, count in result["codes"].items())
    counts = result["within"], result["good_beyond"]
    return (*first, mean, median, *counts, shift, turn, codes, "yes" if holds(result) else "NO")


def main(arguments: list[str]) -> None:
    """Render, calibrate and print; with all 40 cells write results/few_images.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.few_images", description=__doc__)
    parser.add_argument("--images", nargs="*", type=int, default=list(IMAGES), metavar="N", help="how many are left")
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=70000)
    asked = parser.parse_args(arguments)
    on_one_core()
    every = [outcomes(asked.first_seed + k, asked.images) for k in range(asked.cells)]
    results = [
        summary(count, outcomes_of_count)
        for count, outcomes_of_count in zip(asked.images, zip(*every, strict=True), strict=True)
    ]
    print(table(HEAD, map(row, results)))
    if tuple(asked.images) == IMAGES and asked.cells >= 40:
        write("few_images", {"rows": results, "first_seed": asked.first_seed})


if __name__ == "__main__":
    main(sys.argv[1:])
