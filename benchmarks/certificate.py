"""Whether the certificate proves what is well posed, in what time, and never claims what is false."""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np

from basecal.cell import Unknown
from basecal.estimation.certificate.certificate import certify, proven_loops
from basecal.estimation.problem.problem import Problem, State, Stops, ViewGroup
from basecal.estimation.solve import Solution, solve, solve_from
from basecal.estimation.start.closed_form import Loop
from basecal.estimation.view.measurement import PoseMeasurement
from basecal.geometry import SE3, Array
from basecal.geometry.se3 import rotation_exp
from basecal.simulation import Scenario, simulate
from basecal.simulation.draw import in_ball
from benchmarks.common import on_one_core, seconds, table, write
from benchmarks.random_starts import Trio, least_cost, least_value, random_rotations, random_trio

KINDS: dict[str, Scenario] = {
    "hand-eye (AX = ZB)": Scenario(layout="eye_in_hand"),
    "eye-to-hand": Scenario(layout="eye_to_hand"),
    "two arms, camera mount known": Scenario(camera_mount="fixed"),
    "two arms (AXB = YCZ)": Scenario(),
}
NOISES_RAD = (0.003, 0.01, 0.03, 0.1)
SPREADS_RAD = (0.6, 1.2, 3.0)
POSITION_M = 2e-3
SIZES = (30, 300, 3000, 10000)
TARGET = 0.95
WELL_POSED_RAD = 1.0
ADVERSARIES = ("bad start", "narrow", "outliers", "few", "one axis", "loud", "far out of scale")
NAMES = {"x": "eye_flange_from_camera", "y": "eye_base_from_hand_base", "z": "hand_flange_from_target"}
BETTER = 1e-6
STARTS = 1000
HEAD = ("what is unknown", "turned by up to [rad]", "noise [rad]", "proven", "median [ms]", "slowest [ms]")
TIME_HEAD = ("samples", "proof of the rotations [ms]", "with the descents [ms]")
FOE_HEAD = ("cells made to deceive", "cells", "claimed", "random starts", "false")


class Claims(NamedTuple):
    """Cells of one kind and noise: how many, proven ones, time of the processor, and the reasons of the others."""

    kind: str
    spread_rad: float
    noise_rad: float
    cells: int
    proven: int
    median_ms: float
    slowest_ms: float
    reasons: dict[str, int]


def well_posed(kind: str, spread: float, noise: float, cells: int) -> Claims:
    """Rotation noise of that sigma per axis on the observed poses and on those of every arm, stated as such."""
    sigma = (POSITION_M, noise)
    scenario = replace(KINDS[kind], target="pose", samples=30, spread_rad=spread, pose_noise=sigma, robot_noise=sigma)
    times, reasons = [], {}
    for seed in range(cells):
        made = simulate(scenario, seed)
        solution = solve(made.cell, made.recording)
        began = time.process_time()
        certificate = certify(solution).certificate
        times.append(1e3 * (time.process_time() - began))
        reason = "" if certificate.is_global else certificate.reason
        reasons[reason] = reasons.get(reason, 0) + 1
    proven = reasons.pop("", 0)
    return Claims(kind, spread, noise, cells, proven, float(np.median(times)), max(times), reasons)


def timings(samples: int) -> dict[str, Any]:
    """Time [ms] of the proof of the rotations alone, and of all, by the number of samples."""
    made = simulate(Scenario(target="pose", samples=samples), 0)
    solution = solve(made.cell, made.recording)
    return {
        "samples": samples,
        "rotations_ms": 1e3 * min(seconds(lambda: proven_loops(solution)) for _ in range(3)),
        "all_ms": 1e3 * min(seconds(lambda: certify(solution)) for _ in range(3)),
        "global": certify(solution).certificate.is_global,
    }


def _poses(rng: np.random.Generator, count: int, spread: float, axis: bool) -> SE3:
    """Flange poses turned by up to `spread` [rad], about one axis or all."""
    turns = in_ball(rng, count, spread)
    if axis:
        turns = turns[:, :1] * np.array([0.0, 0.0, 1.0]) + 1e-3 * rng.standard_normal((count, 3))
    home = random_rotations(rng, 1)[0]
    return SE3(rotation_exp(turns) @ home, in_ball(rng, count, 0.4))


def _noisy(pose: SE3, rng: np.random.Generator, sigma: tuple[float, float]) -> SE3:
    noise = rng.standard_normal((len(pose), 6)) * np.repeat(sigma, 3)
    return pose @ SE3.exp(noise)


def adversarial(kind: str, seed: int) -> tuple[Problem, State, Loop, Array]:
    """A cell made to deceive, a start for it, its loop and weights.

    The arms' noise is not stated; the sigmas of the poses are stated, and often wrong.
    """
    rng = np.random.default_rng([seed, ADVERSARIES.index(kind)])
    dual = bool(rng.random() < 0.5)
    count = int(rng.integers(4, 8) if kind == "few" else rng.integers(8, 16))
    spread = float(10 ** rng.uniform(-2, -0.3) if kind == "narrow" else rng.uniform(0.5, 3.0))
    noise = float(10 ** rng.uniform(-0.7, 0.2) if kind == "loud" else 10 ** rng.uniform(-3, -1))
    sigma = (noise * float(10 ** rng.uniform(-2, 0)), noise)
    axis = kind == "one axis"
    a, c = _poses(rng, count, spread, axis), _poses(rng, count, spread, axis)
    x, y, z = (SE3(random_rotations(rng, 1)[0], in_ball(rng, 1, 0.5)[0]) for _ in range(3))
    if not dual:
        c, y = SE3.identity((count,)), SE3.identity()
    b = _noisy((a @ x).inverse() @ y @ c @ z, rng, sigma)
    a, c = _noisy(a, rng, (1e-3, noise / 3)), _noisy(c, rng, (1e-3, noise / 3)) if dual else c
    if kind == "outliers":
        b = _with_outliers(b, rng)
    stated = np.array(sigma) * (10 ** rng.uniform(-1.5, 1.5, 2) if kind == "far out of scale" else 1.0)
    weight = np.tile(1 / np.repeat(stated, 3), (count, 1))
    problem = _problem(a, b, c, weight, dual)
    loop = Loop(a, b, c, None, None if dual else SE3.identity(), None, np.ones(count))
    start = random_trio(loop, rng, 1) if kind == "bad start" else Trio(*(SE3.stack([t]) for t in (x, y, z)))
    state = State({NAMES[name]: value[0] for name, value in start._asdict().items()}, {}, np.zeros((0, 6)))
    return problem, state, loop, weight


def _with_outliers(b: SE3, rng: np.random.Generator) -> SE3:
    """Some poses anywhere, or all of them turned alike."""
    wrong = rng.random(len(b)) < rng.uniform(0.05, 0.5)
    turned = random_rotations(rng, 1) if rng.random() < 0.5 else random_rotations(rng, len(b))
    rotation = np.where(wrong[:, None, None], b.rotation @ turned, b.rotation)
    return SE3(rotation, b.translation + wrong[:, None] * in_ball(rng, len(b), 0.3))


def _problem(a: SE3, b: SE3, c: SE3, weight: Array, dual: bool) -> Problem:
    rows, none = np.arange(len(a)), np.full(len(a), -1)
    views = PoseMeasurement(b, weight, weight)
    hand, base = ("hand", NAMES["y"]) if dual else (None, None)
    mounts = NAMES["x"], NAMES["z"]
    group = ViewGroup("camera", "target", "eye", hand, *mounts, None, base, rows, a, c, none, none, rows, rows, views)
    names = [NAMES[name] for name in ("xyz" if dual else "xz")]
    columns = {name: slice(6 * i, 6 * i + 6) for i, name in enumerate(names)}
    return Problem("eye", (group,), {n: Unknown() for n in names}, frozenset(), {}, Stops(np.zeros((0, 6))), columns)


class Verdict(NamedTuple):
    """One adversarial cell: what was claimed, and what random starts found."""

    kind: str
    seed: int
    claim: str
    cost: float
    starts: int
    least: float
    false: bool


def tried(kind: str, seed: int) -> Verdict:
    """Solve and certify an adversarial cell; hold a thousand random starts against a claim."""
    problem, start, loop, weight = adversarial(kind, seed)
    solution = solve_from(problem, start)
    found = certify(solution)
    if found.better is not None:
        first = solution.cost
        solution = solve_from(problem, found.better)
        found = certify(solution)
        if not solution.cost < first:
            return Verdict(kind, seed, "worse", solution.cost, 0, first, True)
    if not found.certificate.is_global:
        return Verdict(kind, seed, "none", solution.cost, 0, np.nan, False)
    rng = np.random.default_rng([seed, 99])
    least = least_cost(loop, weight, random_trio(loop, rng, STARTS), solution.cost)
    false = least < solution.cost * (1 - BETTER) or _rotations_undercut(solution, rng)
    return Verdict(kind, seed, "global", solution.cost, STARTS, least, bool(false))


def _rotations_undercut(solution: Solution, rng: np.random.Generator) -> bool:
    """Whether a thousand random starts of the rotations alone end below what is proven of them."""
    proven = proven_loops(solution)[0][0]
    if proven is None:
        return True
    return least_value(proven.form.form, len(proven.bound.factors), rng, STARTS) < proven.bound.lower - 1e-12


def deceived(cells: int, workers: int) -> list[Verdict]:
    """So many adversarial cells, the kinds in turn."""
    asked = [(ADVERSARIES[k % len(ADVERSARIES)], k // len(ADVERSARIES)) for k in range(cells)]
    done: list[Verdict] = []
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for verdict in pool.map(tried, *zip(*asked, strict=True), chunksize=4):
            done.append(verdict)
            if len(done) % 100 == 0:
                print(f"{len(done)} of {cells}, {sum(v.false for v in done)} false", file=sys.stderr, flush=True)
    return done


def _foes(kind: str, verdicts: list[Verdict]) -> dict[str, Any]:
    ours = [v for v in verdicts if kind in (v.kind, "all")]
    claimed = [v for v in ours if v.claim == "global"]
    return {
        "kind": kind,
        "cells": len(ours),
        "claimed": len(claimed),
        "starts": sum(v.starts for v in claimed),
        "false": [[v.kind, v.seed, v.cost, v.least] for v in ours if v.false],
    }


def row(of: dict[str, Any]) -> tuple[object, ...]:
    """A row of the table of well-posed cells."""
    proven = f"{of['proven']} of {of['cells']}"
    return of["kind"], of["spread_rad"], of["noise_rad"], proven, f"{of['median_ms']:.0f}", f"{of['slowest_ms']:.0f}"


def time_row(of: dict[str, Any]) -> tuple[object, ...]:
    """A row of the table of times."""
    return of["samples"], f"{of['rotations_ms']:.0f}", f"{of['all_ms']:.0f}"


def foe_row(of: dict[str, Any]) -> tuple[object, ...]:
    """A row of the table of adversarial cells."""
    return of["kind"], of["cells"], of["claimed"], of["starts"], len(of["false"])


def main(arguments: list[str]) -> None:
    """Run, print, write results/certificate.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.certificate", description=__doc__)
    parser.add_argument("--cells", type=int, default=10000, help="adversarial cells")
    parser.add_argument("--well-posed", type=int, default=20, help="cells of each kind, spread and noise")
    parser.add_argument("--workers", type=int, default=1, help="processes for the adversarial cells")
    asked = parser.parse_args(arguments)
    verdicts = deceived(asked.cells, asked.workers)
    on_one_core()
    posed = [
        well_posed(kind, spread, noise, asked.well_posed)._asdict()
        for kind in KINDS
        for spread in SPREADS_RAD
        for noise in NOISES_RAD
    ]
    print(table(HEAD, map(row, posed)))
    times = [timings(samples) for samples in SIZES]
    print("\n" + table(TIME_HEAD, map(time_row, times)))
    foes = [_foes(kind, verdicts) for kind in (*ADVERSARIES, "all")]
    print("\n" + table(FOE_HEAD, map(foe_row, foes)))
    of = [p for p in posed if p["spread_rad"] >= WELL_POSED_RAD]
    rate = sum(p["proven"] for p in of) / sum(p["cells"] for p in of)
    result = {"target": TARGET, "rate": rate, "well_posed_rad": WELL_POSED_RAD, "better": BETTER}
    print(f"\nwritten: {write('certificate', {**result, 'posed': posed, 'times': times, 'foes': foes}).name}")


if __name__ == "__main__":
    main(sys.argv[1:])
