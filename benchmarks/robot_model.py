"""Two arms of six axes with joint offsets: the benefit of estimating them, and whether the need is detected.

Cells have a board, 60 samples, 0.2 px, and offsets of 0.2 deg on every joint, drawn from the prior that the solver is
given. The error of `camera_from_target` is measured at 30 configurations that the solver has not seen. Its rms over the
cells must be 20 times smaller than with the offsets ignored.

The first and the last joint of an arm are constrained by their prior alone, and the sigma of the base contains them.
NEES / 6 of the base has mean 1, over 200 cells within 1 +- 3.5 sqrt(2 / 1200) = [0.857, 1.143]. The 95 % intervals of
the observable offsets must hold the truth in 93 to 97 % (1,600 intervals have a standard error of 0.5 %).

The model is chosen in cells of three kinds: with robots as stated, with offsets of 0.2 deg, and with errors of 0.5 mm
and 1 mrad per axis of every link.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from basecal.accuracy.cross_validation.robot_model_selection import choose_robot_model
from basecal.accuracy.robot_parameters import robot_parameters
from basecal.cell import Recording
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution, solve
from basecal.simulation import Scenario, SimulatedCell, simulate
from benchmarks.common import table, write

BASE = "eye_base_from_hand_base"
SAMPLES, HELD_OUT = 60, 30
SIGMA_RAD = float(np.deg2rad(0.2))
LINK_ERROR = (5e-4, 1e-3)
WITHIN_95 = 1.959964

_ARMS = Scenario(samples=SAMPLES + HELD_OUT, joints=True, pixel_px=0.2)
OFFSETS = replace(_ARMS, joint_offset_rad=SIGMA_RAD, joint_offsets="prior")
KINDS = {
    "none": replace(_ARMS, samples=SAMPLES),
    "offsets": replace(_ARMS, samples=SAMPLES, joint_offset_rad=SIGMA_RAD),
    "links": replace(_ARMS, samples=SAMPLES, link_error=LINK_ERROR),
}


@dataclass(frozen=True)
class Outcome:
    """One cell, offsets ignored and estimated: errors at held-out configurations, of the base, and its NEES."""

    ignored_m: float
    estimated_m: float
    ignored_rad: float
    estimated_rad: float
    base_ignored_m: float
    base_estimated_m: float
    nees: float
    inside: int
    seen: int
    held: tuple[tuple[str, int], ...]


def solve_cell(seed: int) -> Outcome:
    """Solve a cell with its offsets ignored and with their prior."""
    simulated = simulate(OFFSETS, seed)
    recording = Recording(simulated.recording.samples[:SAMPLES])
    without_offsets = {name: replace(robot, parameters={}) for name, robot in simulated.cell.robots.items()}
    ignored = solve(replace(simulated.cell, robots=without_offsets), recording)
    estimated = solve(simulated.cell, recording)
    problem, _ = build_problem(simulated.cell, Recording(simulated.recording.samples[SAMPLES:]))
    errors = [_rms_error(simulated, problem, each) for each in (ignored, estimated)]
    base = estimated.transforms[BASE]
    xi = (base.mean.inverse() @ simulated.truth[BASE]).log()
    offsets = robot_parameters(estimated).get("joint_offsets", {})
    inside = {
        robot: np.abs(estimate.values - simulated.robots[robot].kind_values("joint_offsets"))[estimate.seen]
        < WITHIN_95 * estimate.sigma[estimate.seen]
        for robot, estimate in offsets.items()
    }
    held = tuple((robot, int(j)) for robot, estimate in offsets.items() for j in np.flatnonzero(~estimate.seen))
    return Outcome(
        ignored_m=errors[0][0],
        estimated_m=errors[1][0],
        ignored_rad=errors[0][1],
        estimated_rad=errors[1][1],
        base_ignored_m=float(
            np.linalg.norm((ignored.state.transforms[BASE].inverse() @ simulated.truth[BASE]).translation)
        ),
        base_estimated_m=float(np.linalg.norm(xi[:3])),
        nees=float(xi @ np.linalg.solve(base.covariance, xi)),
        inside=sum(int(each.sum()) for each in inside.values()),
        seen=sum(len(each) for each in inside.values()),
        held=held,
    )


def _rms_error(simulated: SimulatedCell, problem: Problem, solution: Solution) -> tuple[float, float]:
    """Rms error of `camera_from_target` at held-out configurations [m, rad]."""
    truth = State(simulated.truth, simulated.cameras, np.zeros((0, 6)), simulated.robots)
    group = problem.groups[0]
    step = truth.camera_from_target(group, problem.stops).inverse() @ solution.state.camera_from_target(
        group, problem.stops
    )
    return _rms(np.linalg.norm(step.translation, axis=-1)), _rms(np.linalg.norm(step.rotvec, axis=-1))


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def summary(outcomes: list[Outcome]) -> dict[str, Any]:
    """Statistics over all cells."""
    rms = {
        name: _rms([getattr(o, name) for o in outcomes]) for name in Outcome.__annotations__ if name.endswith(_UNITS)
    }
    held = {f"{robot} joint {joint + 1}" for o in outcomes for robot, joint in o.held}
    seen = sum(o.seen for o in outcomes)
    return {
        **rms,
        "times_better": rms["ignored_m"] / rms["estimated_m"],
        "median_times_better": float(np.median([o.ignored_m / o.estimated_m for o in outcomes])),
        "nees_over_6": float(np.mean([o.nees for o in outcomes])) / 6,
        "coverage_95": sum(o.inside for o in outcomes) / seen,
        "offsets_seen": seen,
        "held_by_prior": sorted(held),
        "held_in_every_cell": all(len(o.held) == len(held) for o in outcomes),
    }


_UNITS = ("_m", "_rad")


def choose_model(kind: str, seed: int) -> str:
    """The model chosen in a cell of a kind: `none`, `offsets` (single joints among them), `links` or `undecided`."""
    simulated = simulate(KINDS[kind], seed)
    choice = choose_robot_model(solve(simulated.cell, simulated.recording))
    if choice is None:
        return "none"
    if choice.better is not None:
        return "undecided"
    return "offsets" if choice.chosen.kind == "joint" else choice.chosen.kind


CHOICE_HEAD = ("truth", "none", "offsets", "links", "undecided")
HEAD = ("of camera_from_target, held out", "offsets ignored", "offsets estimated")


def rows(result: dict[str, Any]) -> list[tuple[str, ...]]:
    """Lines of the table with `HEAD`."""
    pairs = (
        ("rms error [mm]", "{}_m", 1e3),
        ("rms error [deg]", "{}_rad", np.degrees(1)),
        ("of the base, rms error [mm]", "base_{}_m", 1e3),
    )
    return [
        (label, *(f"{scale * result[key.format(model)]:.4g}" for model in ("ignored", "estimated")))
        for label, key, scale in pairs
    ]


def choice_rows(choices: dict[str, dict[str, int]]) -> list[tuple[str, ...]]:
    """Lines of the table with `CHOICE_HEAD`."""
    return [(kind, *(str(counts.get(name, 0)) for name in CHOICE_HEAD[1:])) for kind, counts in choices.items()]


def main(arguments: list[str]) -> None:
    """Run, print; with the full number of cells write results/robot_model.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robot_model", description=__doc__)
    parser.add_argument("--cells", type=int, default=200, help="of each part (default 200)")
    parser.add_argument("--first-seed", type=int, default=0)
    asked = parser.parse_args(arguments)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    seeds = range(asked.first_seed, asked.first_seed + asked.cells)
    outcomes = []
    for k, seed in enumerate(seeds):
        outcomes.append(solve_cell(seed))
        if k % 20 == 19:
            print(f"{k + 1} cells solved", flush=True)
    result = summary(outcomes)
    choices: dict[str, dict[str, int]] = {kind: {} for kind in KINDS}
    for k, seed in enumerate(seeds):
        kind = list(KINDS)[k % len(KINDS)]
        chosen = choose_model(kind, seed)
        choices[kind][chosen] = choices[kind].get(chosen, 0) + 1
        if k % 20 == 19:
            print(f"{k + 1} models chosen", flush=True)
    print(f"\n{table(HEAD, rows(result))}\n")
    print(f"{result['times_better']:.0f} times better; NEES / 6 of the base {result['nees_over_6']:.3f};")
    print(f"{100 * result['coverage_95']:.1f} % of {result['offsets_seen']} intervals of seen offsets hold the truth;")
    print(f"by their prior alone: {', '.join(result['held_by_prior'])}\n")
    print(table(CHOICE_HEAD, choice_rows(choices)))
    if asked.cells >= parser.get_default("cells"):
        write("robot_model", {"cells": asked.cells, "first_seed": asked.first_seed, **result, "choices": choices})


if __name__ == "__main__":
    main(sys.argv[1:])
