"""A published protocol: errors of the base by ours beside those that Sui and Ding 2023 print.

Noise on all three poses of A X B = Y C Z. How far poses reach and along which axes the noise is drawn is not stated:
here it is normal, with the variance of a uniform one of that half width per axis, on flanges that turn up to 1.5 rad
about a target 0.5 to 0.9 m away. The published figures are a guide, not a test.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

import numpy as np

from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate
from benchmarks.common import table, write

UNIFORM = 3**-0.5  # standard deviation of a uniform distribution over its half width
PUBLISHED = {
    (0.5, 30): (2.6, 2.7),
    (0.5, 270): (0.8, 0.8),
    (1.8, 30): (9.5, 10.0),
    (1.8, 270): (3.0, 3.0),
}
"""By noise [mm and deg] and samples: the base's error [mrad, mm]."""

CELLS = 40
HEAD = ("noise", "samples", "cells", "ours [mrad]", "published", "ours [mm]", "published", "NEES/6")


def measured(noise: float, samples: int, cells: int) -> dict[str, Any]:
    """Mean errors of the base over cells."""
    sigmas = (UNIFORM * noise * 1e-3, float(np.radians(UNIFORM * noise)))
    scenario = Scenario(
        samples=samples, target="pose", robot_noise=sigmas, pose_noise=sigmas, spread_rad=1.5, position_m=0.3
    )
    errors, nees = [], []
    for seed in range(cells):
        made = simulate(scenario, seed)
        found = solve(made.cell, made.recording, Settings(robot_noise="stated")).transforms["eye_base_from_hand_base"]
        error = (found.mean.inverse() @ made.truth["eye_base_from_hand_base"]).log()
        errors.append(error)
        nees.append(error @ np.linalg.solve(found.covariance, error))
    off = np.stack(errors)
    means = [float(1e3 * np.linalg.norm(part, axis=-1).mean()) for part in (off[:, 3:], off[:, :3])]
    case = {"noise": noise, "samples": samples, "cells": cells}
    return {**case, "mrad": means[0], "mm": means[1], "nees_over_6": float(np.mean(nees) / 6)}


def row(found: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    mrad, mm = PUBLISHED[found["noise"], found["samples"]]
    noise = f"{found['noise']:g} mm, {found['noise']:g} deg"
    ours = f"{found['mrad']:.2f}", f"{mrad:g}", f"{found['mm']:.2f}", f"{mm:g}"
    return noise, str(found["samples"]), str(found["cells"]), *ours, f"{found['nees_over_6']:.2f}"


def main(arguments: list[str]) -> None:
    """Measure, print, write results/published.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.published", description=__doc__)
    parser.add_argument("--cells", type=int, default=CELLS)
    cells = parser.parse_args(arguments).cells
    rows = [measured(noise, samples, cells) for noise, samples in PUBLISHED]
    print(table(HEAD, map(row, rows)))
    write("published", {"rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
