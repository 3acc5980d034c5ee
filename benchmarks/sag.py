"""How far a sag can be detected: the part that is a tilt of the base by definition, and the power of a perfect test.

Cells are those of `wrong_answers` in which the hand's flange sags in proportion to its reach. All noise is known here,
and no other error is tested for, so that no test of these recordings has more power. The power is that of a chi-square
test. The noncentrality is the squared sag times the information of the recording, with all unknowns of the cell
eliminated. The answer itself is not wrong, since the base is defined by its poses.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2, ncx2

from basecal.accuracy.systematic_errors.score_tests import linearise_views, score
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Recording
from basecal.effects.bending import candidates as sag
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_problem
from basecal.geometry import SE3
from benchmarks.common import on_one_core, table, write
from benchmarks.wrong_answers import NOISE, SAG_PER_M, sagging_arm

SIZES = (1e-3, 2e-3, 4e-3, 8e-3)  # [rad/m]
CHANCE = 1e-3  # false-alarm probability of a warning
FREEDOMS = {"any": 3, "known": 1}  # of a sag, with any or the known direction of gravity
HEAD = (
    "sag [mrad/m]",
    "rotation [mrad]",
    "rotation without the tilt [mrad]",
    "noncentrality, median",
    "found, down unknown",
    "found, down known",
)


class SagInformation(NamedTuple):
    """Information of a cell about the sag [m^2], and rotation of the hand with and without tilt, rms [rad/(rad/m)]."""

    information: float
    turn: float
    less_tilt: float


def measure(seed: int) -> SagInformation:
    """Solve one cell with its true noise."""
    drawn = sagging_arm(seed)
    robots = {name: replace(robot, noise=np.repeat(NOISE, 3)) for name, robot in drawn.cell.robots.items()}
    cell = replace(drawn.cell, robots=robots)
    problem, _ = build_problem(cell, drawn.recording)
    solution = solve_problem(problem, cell, Settings(robot_noise="stated"))
    situation = Situation(solution.problem, solution.state, problem, {})
    hand_sag = next(each for each in sag(situation) if each.about == ("hand",))
    information = score(linearise_views(situation.problem, situation.state), hand_sag).information[0]
    turns = _rotations(drawn.recording)
    return SagInformation(float(information[0, 0]), _rms(turns), _rms(turns - turns.mean(0)))


def _rotations(recording: Recording) -> np.ndarray:
    """Rotations by a sag of 1 rad/m, about axes of the base, (n, 3)."""
    poses = [s.robots["hand"].base_from_flange for s in recording.samples]
    return np.cross(SE3.stack([p for p in poses if p is not None]).translation, [0, 0, -1.0])


def _rms(turns: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(turns**2, -1))))


def summary(cells: list[SagInformation], size: float) -> dict[str, float]:
    """The effect of a sag of a size, and the expected number of cells in which a perfect test finds it."""
    shifts = np.array([size**2 * cell.information for cell in cells])
    detected = {k: float(ncx2.sf(chi2.isf(CHANCE, q), q, shifts).sum()) for k, q in FREEDOMS.items()}
    turn, less_tilt = (size * float(np.median([getattr(c, k) for c in cells])) for k in ("turn", "less_tilt"))
    return {"size": size, "turn": turn, "less_tilt": less_tilt, "shift": float(np.median(shifts)), **detected}


def row(result: dict[str, float]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    mrad = [f"{1e3 * result[k]:.3g}" for k in ("size", "turn", "less_tilt")]
    return (*mrad, f"{result['shift']:.1f}", *(f"{result[k]:.1f}" for k in FREEDOMS))


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
{result["cells"]} cells of `benchmarks.wrong_answers` whose hand sags, with sags of other sizes as well. The sag there
is {1e3 * SAG_PER_M:g} mrad a metre. The part of the sag that all poses share is by definition a tilt of the base. At
{1e3 * SAG_PER_M:g} mrad a metre the remaining rotation of the hand is no larger than its noise of {1e3 * NOISE[1]:g}
mrad.

`found` is the expected number of cells in which a perfect test finds the sag. This test knows all noise, tests for
nothing else, and has a false-alarm probability of {CHANCE:g}. The noncentrality is that of its chi-square."""
    return f"{about}\n\n{table(HEAD, map(row, result['rows']))}"


def main(arguments: list[str]) -> None:
    """Solve, print; with forty cells or more write results/sag.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sag", description=__doc__)
    parser.add_argument("--cells", type=int, default=40)
    asked = parser.parse_args(arguments)
    on_one_core()
    cells = [measure(seed) for seed in range(asked.cells)]
    rows = [summary(cells, size) for size in SIZES]
    print(table(HEAD, map(row, rows)))
    if asked.cells >= parser.get_default("cells"):
        write("sag", {"cells": len(cells), "rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
