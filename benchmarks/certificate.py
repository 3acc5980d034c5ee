"""Whether the certificate proves well-posed cells, its time, and whether it ever makes a false claim."""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
from tests.shared.deceivers import ADVERSARIES, COST_GAIN, POSITION_M, Verdict, trial

from basecal.estimation.certificate.certificate import certify, proven_loops
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate
from benchmarks.common import on_one_core, seconds, table, write

KINDS: dict[str, Scenario] = {
    "hand-eye (AX = ZB)": Scenario(layout="eye_in_hand"),
    "eye-to-hand": Scenario(layout="eye_to_hand"),
    "two arms, camera mount known": Scenario(camera_mount="fixed"),
    "two arms (AXB = YCZ)": Scenario(),
}
NOISES_RAD = (0.003, 0.01, 0.03, 0.1)
SPREADS_RAD = (0.6, 1.2, 3.0)
SIZES = (30, 300, 3000, 10000)
TARGET = 0.95
WELL_POSED_RAD = 1.0
HEAD = ("cell", "rotation up to [rad]", "noise [rad]", "proven", "median [ms]", "slowest [ms]")
TIME_HEAD = ("samples", "proof of the rotations [ms]", "with the descents [ms]")
ADVERSARIAL_HEAD = ("adversarial cells", "cells", "claimed", "random starts", "false")


class Claims(NamedTuple):
    """Cells of one kind and noise: their number, proven ones, CPU times, and the reasons of the others."""

    kind: str
    spread_rad: float
    noise_rad: float
    cells: int
    proven: int
    median_ms: float
    slowest_ms: float
    reasons: dict[str, int]


def prove_cells(kind: str, spread: float, noise: float, cells: int) -> Claims:
    """Certify cells with that rotation noise per axis, stated, on the observed poses and on those of every arm."""
    sigma = (POSITION_M, noise)
    scenario = replace(KINDS[kind], target="pose", samples=30, spread_rad=spread, pose_noise=sigma, robot_noise=sigma)
    times, reasons = [], {}
    for seed in range(cells):
        simulated = simulate(scenario, seed)
        solution = solve(simulated.cell, simulated.recording)
        began = time.process_time()
        certificate = certify(solution).certificate
        times.append(1e3 * (time.process_time() - began))
        reason = "" if certificate.is_global else certificate.reason
        reasons[reason] = reasons.get(reason, 0) + 1
    proven = reasons.pop("", 0)
    return Claims(kind, spread, noise, cells, proven, float(np.median(times)), max(times), reasons)


def timings(samples: int) -> dict[str, Any]:
    """Time [ms] of the proof of the rotations alone, and of the whole certificate, by the number of samples."""
    simulated = simulate(Scenario(target="pose", samples=samples), 0)
    solution = solve(simulated.cell, simulated.recording)
    return {
        "samples": samples,
        "rotations_ms": 1e3 * min(seconds(lambda: proven_loops(solution)) for _ in range(3)),
        "all_ms": 1e3 * min(seconds(lambda: certify(solution)) for _ in range(3)),
        "global": certify(solution).certificate.is_global,
    }


def challenge_cells(cells: int, workers: int) -> list[Verdict]:
    """Verdicts on a number of adversarial cells, the kinds in turn."""
    cases = [(ADVERSARIES[k % len(ADVERSARIES)], k // len(ADVERSARIES)) for k in range(cells)]
    verdicts: list[Verdict] = []
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for verdict in pool.map(trial, *zip(*cases, strict=True), chunksize=4):
            verdicts.append(verdict)
            if len(verdicts) % 100 == 0:
                print(
                    f"{len(verdicts)} of {cells}, {sum(v.false for v in verdicts)} false", file=sys.stderr, flush=True
                )
    return verdicts


def _adversarial_summary(kind: str, verdicts: list[Verdict]) -> dict[str, Any]:
    ours = [v for v in verdicts if kind in (v.kind, "all")]
    claimed = [v for v in ours if v.claim == "global"]
    return {
        "kind": kind,
        "cells": len(ours),
        "claimed": len(claimed),
        "starts": sum(v.starts for v in claimed),
        "false": [[v.kind, v.seed, v.cost, v.least] for v in ours if v.false],
    }


def row(claims: dict[str, Any]) -> tuple[object, ...]:
    """A row of the table of well-posed cells."""
    proven = f"{claims['proven']} of {claims['cells']}"
    return (
        claims["kind"],
        claims["spread_rad"],
        claims["noise_rad"],
        proven,
        f"{claims['median_ms']:.0f}",
        f"{claims['slowest_ms']:.0f}",
    )


def time_row(times: dict[str, Any]) -> tuple[object, ...]:
    """A row of the table of times."""
    return times["samples"], f"{times['rotations_ms']:.0f}", f"{times['all_ms']:.0f}"


def adversarial_row(counts: dict[str, Any]) -> tuple[object, ...]:
    """A row of the table of adversarial cells."""
    return counts["kind"], counts["cells"], counts["claimed"], counts["starts"], len(counts["false"])


def main(arguments: list[str]) -> None:
    """Run, print, write results/certificate.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.certificate", description=__doc__)
    parser.add_argument("--cells", type=int, default=10000, help="adversarial cells")
    parser.add_argument("--well-posed", type=int, default=20, help="cells of each kind, spread and noise")
    parser.add_argument("--workers", type=int, default=1, help="processes for the adversarial cells")
    asked = parser.parse_args(arguments)
    verdicts = challenge_cells(asked.cells, asked.workers)
    on_one_core()
    posed = [
        prove_cells(kind, spread, noise, asked.well_posed)._asdict()
        for kind in KINDS
        for spread in SPREADS_RAD
        for noise in NOISES_RAD
    ]
    print(table(HEAD, map(row, posed)))
    times = [timings(samples) for samples in SIZES]
    print("\n" + table(TIME_HEAD, map(time_row, times)))
    adversarial = [_adversarial_summary(kind, verdicts) for kind in (*ADVERSARIES, "all")]
    print("\n" + table(ADVERSARIAL_HEAD, map(adversarial_row, adversarial)))
    far_rotated = [p for p in posed if p["spread_rad"] >= WELL_POSED_RAD]
    rate = sum(p["proven"] for p in far_rotated) / sum(p["cells"] for p in far_rotated)
    result = {"target": TARGET, "rate": rate, "well_posed_rad": WELL_POSED_RAD, "better": COST_GAIN}
    print(f"\nwritten: {write('certificate', {**result, 'posed': posed, 'times': times, 'foes': adversarial}).name}")


if __name__ == "__main__":
    main(sys.argv[1:])
