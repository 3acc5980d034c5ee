"""Whether covariances are true from rendered images, thinned to few: nothing stated, robots with usual noise.

Each cell has two arms, the camera on one, a ChArUco board on the other, both mounts unknown. Its 24 images are
rendered, what they show is detected, and random ones are left. NEES is the base's squared Mahalanobis distance from the
truth. From ten images on its mean over six freedoms is to lie in a band; with fewer the truth in the 95 % ellipsoid.
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
ENOUGH = 10
# Of 40 cells: the mean of 40 chi-squares of six freedoms, over six, scatters by 0.09; upwards its tails are longer.
BAND = (0.7, 1.4)
HELD, LEAST_HELD = 0.95, 35 / 40
BEYOND = 0.999
HEAD = ("images", "cells", "refused", "doubtful", "good", "NEES/6, mean", "median", "within 95 %",
        "good beyond 99.9 %", "translation, rms [mm]", "rotation, rms [mrad]", "findings", "holds")  # fmt: skip


class Outcome(NamedTuple):
    """One cell of some of its images; errors are NaN where no base was given."""

    verdict: str
    nees: float
    shift_m: float
    turn_rad: float
    codes: list[str]


def photographed(seed: int) -> tuple[SimulatedCell, Recording]:
    """A cell and what its rendered images show."""
    made = simulate(_SCENARIO, seed)
    with tempfile.TemporaryDirectory() as folder:
        return made, detect(made.cell, render_recording(made, Path(folder), seed=1000 * seed))


def outcomes(seed: int, counts: Sequence[int]) -> list[Outcome]:
    """A cell by so many of its images each: of a random order the first."""
    made, recording = photographed(seed)
    order = np.random.default_rng([seed, 1]).permutation(len(recording.samples))
    return [_outcome(made, recording, np.sort(order[:count]).tolist()) for count in counts]


def _outcome(made: SimulatedCell, recording: Recording, rows: list[int]) -> Outcome:
    few = tuple(replace(recording.samples[k], images={}) for k in rows)
    found = calibrate(made.cell, replace(recording, samples=few))
    codes = [f.code for f in found.findings if f.severity != "info"]
    if BASE not in found.transforms:
        return Outcome("refused", np.nan, np.nan, np.nan, codes)
    xi = (found[BASE].mean.inverse() @ made.truth[BASE]).log()
    nees = float(xi @ np.linalg.solve(found[BASE].covariance, xi))
    return Outcome(found.verdict, nees, float(np.linalg.norm(xi[:3])), float(np.linalg.norm(xi[3:])), codes)


def summary(count: int, of: Sequence[Outcome]) -> dict[str, Any]:
    """Of all cells by so many images."""
    given = [o for o in of if not np.isnan(o.nees)]
    nees = np.array([o.nees for o in given]) / 6
    beyond = chi2.ppf(HELD, 6) / 6
    shift, turn = ([getattr(o, name) for o in given] for name in ("shift_m", "turn_rad"))
    return {
        "pictures": count,
        "cells": len(of),
        **{verdict: sum(o.verdict == verdict for o in of) for verdict in ("refused", "doubtful", "good")},
        "mean": float(nees.mean()) if given else None,
        "median": float(np.median(nees)) if given else None,
        "within": int((nees <= beyond).sum()),
        "good_beyond": sum(o.verdict == "good" and bool(o.nees > chi2.ppf(BEYOND, 6)) for o in given),
        "shift_mm": 1e3 * float(np.sqrt(np.mean(np.square(shift)))) if given else None,
        "turn_mrad": 1e3 * float(np.sqrt(np.mean(np.square(turn)))) if given else None,
        "codes": dict(Counter(code for o in of for code in set(o.codes)).most_common()),
    }


def holds(found: dict[str, Any]) -> bool:
    """Whether what is asked is so."""
    if found["pictures"] >= ENOUGH:
        return found["mean"] is not None and bool(BAND[0] <= found["mean"] <= BAND[1])
    return bool(found["within"] + found["refused"] >= LEAST_HELD * found["cells"])


def row(found: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    first = tuple(found[k] for k in ("pictures", "cells", "refused", "doubtful", "good"))
    mean, median, shift, turn = (
        "" if found[k] is None else f"{found[k]:.2f}" for k in ("mean", "median", "shift_mm", "turn_mrad")
    )
    codes = ", ".join(f"{code} {count}" for code, count in found["codes"].items())
    counts = found["within"], found["good_beyond"]
    return (*first, mean, median, *counts, shift, turn, codes, "yes" if holds(found) else "NO")


def main(arguments: list[str]) -> None:
    """Render, calibrate and print; of all 40 cells write results/few_images.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.few_images", description=__doc__)
    parser.add_argument("--images", nargs="*", type=int, default=list(IMAGES), metavar="N", help="how many are left")
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=70000)
    asked = parser.parse_args(arguments)
    on_one_core()
    every = [outcomes(asked.first_seed + k, asked.images) for k in range(asked.cells)]
    found = [summary(count, of) for count, of in zip(asked.images, zip(*every, strict=True), strict=True)]
    print(table(HEAD, map(row, found)))
    if tuple(asked.images) == IMAGES and asked.cells >= 40:
        write("few_images", {"rows": found, "first_seed": asked.first_seed})


if __name__ == "__main__":
    main(sys.argv[1:])
