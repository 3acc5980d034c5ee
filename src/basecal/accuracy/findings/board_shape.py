"""`board-shape`: a board that is not as flat as stated."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.significance import SIGNIFICANCE
from basecal.cell import Finding
from basecal.estimation.noise.board_bow import COEFFICIENTS, height_m
from basecal.geometry import Array

_WORTH_SAYING_M = 1e-4  # [m] below which no other board is worth its price
_BEYOND_PRINTS = 3.0  # coefficients in sigmas of what printed boards have, beyond which something else bends the views


def board_shape(of: Evidence) -> list[Finding]:
    """An info about each board that is bowed beyond chance; a warning where no board is bowed so much."""
    return [f for name, (bow, spread) in of.solution.noise.bows.items() for f in _of_board(of, name, bow, spread)]


def _of_board(of: Evidence, name: str, bow: Array, spread: Array) -> list[Finding]:
    target = of.cell.targets[name].target
    if target is None or chi2.sf(bow @ np.linalg.solve(spread, bow), COEFFICIENTS) > SIGNIFICANCE:
        return []
    height = height_m(target.points, bow)
    bent = bool(np.abs(bow).max() > _BEYOND_PRINTS)
    if height < _WORTH_SAYING_M and not bent:
        return []
    message = f"{name} is not flat: its points lie up to {1e3 * height:.2g} mm off their plane"
    if bent:
        message += ", more than printed boards do: check the points stated, the lens model and the target's size"
        return [Finding("board-shape", "warning", (name,), message)]
    message += "; the answer takes that into account; a board on glass or aluminium needs no such correction"
    return [Finding("board-shape", "info", (name,), message)]
