"""How far a sag can be told at all: what of it is a tilt of the base by definition, and what a perfect test would see.

Cells are those of `wrong_answers` in which the hand's flange sags in proportion to its reach. All noise is known here,
and no other error is looked for, so that no test of these recordings sees more: it finds a sag as often as a
non-central chi-square beats chance, whose shift is the sag squared times what the recording says of it, all unknowns of
the cell eliminated. The answer itself is not wrong: where a base is, its poses say.
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
from benchmarks.wrong_answers import NOISE, SAG_PER_M, sagging

SIZES = (1e-3, 2e-3, 4e-3, 8e-3)  # [rad/m]
CHANCE = 1e-3  # that is told as a warning
FREEDOMS = {"any": 3, "known": 1}  # of a sag, by what is known of where down is
HEAD = (
    "sag [mrad/m]",
    "rotation [mrad]",
    "rotation without the tilt [mrad]",
    "noncentrality, median",
    "found, down unknown",
    "found, down known",
)


class Told(NamedTuple):
    """Of one cell: what the recording says of the sag [m^2], and how far it turns the hand, rms [rad per rad/m]."""

    information: float
    turn: float
    less_tilt: float


def told(seed: int) -> Told:
    """One cell, solved with its true noise."""
    drawn = sagging(seed)
    robots = {name: replace(robot, noise=np.repeat(NOISE, 3)) for name, robot in drawn.cell.robots.items()}
    cell = replace(drawn.cell, robots=robots)
    problem, _ = build_problem(cell, drawn.recording)
    solution = solve_problem(problem, cell, Settings(robot_noise="stated"))
    situation = Situation(solution.problem, solution.state, problem, {})
    of_hand = next(each for each in sag(situation) if each.about == ("hand",))
    information = score(linearise_views(situation.problem, situation.state), of_hand).information[0]
    turns = _turns(drawn.recording)
    return Told(float(information[0, 0]), _rms(turns), _rms(turns - turns.mean(0)))


def _turns(recording: Recording) -> np.ndarray:
    """By a sag of 1 rad/m, about axes of the base, (n, 3)."""
    poses = [s.robots["hand"].base_from_flange for s in recording.samples]
    return np.cross(SE3.stack([p for p in poses if p is not None]).translation, [0, 0, -1.0])


def _rms(turns: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(turns**2, -1))))


def summary(cells: list[Told], size: float) -> dict[str, float]:
    """What a sag of a size does, and in how many cells a perfect test would find it."""
    shifts = np.array([size**2 * cell.information for cell in cells])
    found = {k: float(ncx2.sf(chi2.isf(CHANCE, q), q, shifts).sum()) for k, q in FREEDOMS.items()}
    turn, less_tilt = (size * float(np.median([getattr(c, k) for c in cells])) for k in ("turn", "less_tilt"))
    return {"size": size, "turn": turn, "less_tilt": less_tilt, "shift": float(np.median(shifts)), **found}


def row(of: dict[str, float]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    mrad = [f"{1e3 * of[k]:.3g}" for k in ("size", "turn", "less_tilt")]
    return (*mrad, f"{of['shift']:.1f}", *(f"{of[k]:.1f}" for k in FREEDOMS))


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
    """Solve, print; of forty cells and more write results/sag.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sag", description=__doc__)
    parser.add_argument("--cells", type=int, default=40)
    asked = parser.parse_args(arguments)
    on_one_core()
    cells = [told(seed) for seed in range(asked.cells)]
    rows = [summary(cells, size) for size in SIZES]
    print(table(HEAD, map(row, rows)))
    if asked.cells >= parser.get_default("cells"):
        write("sag", {"cells": len(cells), "rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
