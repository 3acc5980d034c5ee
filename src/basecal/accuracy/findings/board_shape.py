"""`board-shape`: a target that is not shaped as stated: a board that is not flat, points in space that are off."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.significance import SIGNIFICANCE
from basecal.cell import Finding
from basecal.estimation.noise.board_bow import height_m
from basecal.estimation.noise.target_shape import is_flat, off_m

_WORTH_SAYING_M = 1e-4  # [m] below which no other target is worth its price
_BEYOND_PRINTS = 3.0  # coefficients in sigmas of what printed targets have, beyond which something else bends the views
_RIGID = 6  # freedoms of a body in space that are no shape of it


def board_shape(of: Evidence) -> list[Finding]:
    """An info about each target that is off its shape beyond chance; a warning where none is made so badly."""
    findings = []
    for name, (shape, spread) in of.solution.noise.shapes.items():
        target = of.cell.targets[name].target
        if target is None:
            continue
        flat = is_flat(target.points)
        freedoms = len(shape) if flat else len(shape) - _RIGID
        is_chance = chdtrc(freedoms, shape @ np.linalg.solve(spread, shape)) > SIGNIFICANCE
        if is_chance:
            continue
        size_m = height_m(target.points, shape) if flat else float(off_m(target.points, shape).max())
        sigmas = float(np.abs(shape).max()) if flat else float(np.sqrt(np.sum(shape**2) / freedoms))
        if size_m < _WORTH_SAYING_M and sigmas < _BEYOND_PRINTS:
            continue
        findings.append(_told(name, size_m, flat, sigmas > _BEYOND_PRINTS))
    return findings


def _told(name: str, size_m: float, flat: bool, bent: bool) -> Finding:
    size = f"up to {1e3 * size_m:.2g} mm"
    what = f"Points of {name} are {size} from where they are stated."
    if flat:
        what = f"{name} is not flat: its points are {size} off their plane."
    if bent:
        why = f"That is more than {'printed boards are' if flat else 'targets are made to'}."
        do = ("Check the stated points, the lens model and the target's size.",)
        return Finding("board-shape", "warning", (name,), what, do, why)
    do = ("Use a board on glass or aluminium.",) if flat else ("Measure the points, and state them.",)
    return Finding("board-shape", "info", (name,), what, do, "The answer contains the shape.")
