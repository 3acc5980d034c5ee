"""Clean recordings of ten kinds with unstated noise: how many are not good, and how well ellipsoids hold.

Command: python -m benchmarks.clean_kinds [--cells 600] [--keep FILE]. The kinds are drawn in turn.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import chi2
from tests.touch_cells import BASE, TRUTH, recorded, touch_cell, touch_lines

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from benchmarks import target_poses
from benchmarks.common import label, run_cells, table

CELLS, HOLD = 600, 0.99
SAMPLES = (16, 30)  # of a recording, at least and at most
TOUCH_M = 2e-4  # sigma of a touch
UNSTATED: dict[str, Any] = {
    "robot_noise": (1e-4, 2e-4),
    "state_robot_noise": False,
    "state_pixel_noise": False,
    "state_observation_noise": False,
}


def simulated_trial(seed: int, **changes: Any) -> dict[str, Any]:
    """The verdict on a simulated cell of usual noise, and squared errors of its free transforms in sigmas."""
    samples = int(np.random.default_rng([seed, 41]).integers(*SAMPLES))
    simulated = simulate(Scenario(samples=samples, **{**UNSTATED, **changes}), seed)
    return _outcome(calibrate(simulated.cell, simulated.recording), simulated.truth)


def pnp_trial(seed: int) -> dict[str, Any]:
    """The same for poses of a tag or of corners by PnP."""
    points = list(target_poses.TARGETS.values())[seed // len(KINDS) % len(target_poses.TARGETS)]
    result = target_poses.trial(seed, SAMPLES[0] + 4, points)
    return {"verdict": result["verdict"], "codes": result["codes"], "squares": [result["square"]]}


def touch_trial(seed: int) -> dict[str, Any]:
    """The same for touches of marks by the tips of two arms."""
    cell = touch_cell()
    lines = touch_lines(np.random.default_rng(seed), SAMPLES[1], TOUCH_M)
    return _outcome(calibrate(cell, recorded(cell, lines)), {BASE: TRUTH})


def _outcome(calibration: Calibration, truth: dict[str, SE3]) -> dict[str, Any]:
    squares = []
    for name, estimate in calibration.transforms.items():
        if name in truth and np.linalg.matrix_rank(estimate.covariance, hermitian=True) == 6:
            off = (estimate.mean.inverse() @ truth[name]).log()
            squares.append(float(off @ np.linalg.solve(estimate.covariance, off)))
    codes = sorted({finding.code for finding in calibration.findings if finding.severity != "info"})
    return {"verdict": calibration.verdict, "codes": codes, "squares": squares}


KINDS: dict[str, Callable[[int], dict[str, Any]]] = {
    "two arms, pixels of a board": simulated_trial,
    "two arms, 3-D points": partial(simulated_trial, target="points3d"),
    "two arms, a light": partial(simulated_trial, target="led"),
    "two arms, one still in turn": partial(simulated_trial, arms="halves"),
    "two arms, joints": partial(simulated_trial, joints=True),
    "three arms in a ring": partial(simulated_trial, layout="ring", robots=3),
    "one arm, camera on it": partial(simulated_trial, layout="eye_in_hand"),
    "one arm, camera beside it": partial(simulated_trial, layout="eye_to_hand"),
    "one arm, poses by PnP": pnp_trial,
    "two arms, touches": touch_trial,
}


def measure(seed: int) -> Iterator[dict[str, Any]]:
    """The outcome of a recording of the kind whose turn it is."""
    kind = list(KINDS)[seed % len(KINDS)]
    yield {"seed": seed, "kind": kind, **KINDS[kind](seed)}


def format_table(results: list[dict[str, Any]]) -> str:
    """A table with a row for each kind and one for all."""
    rows = [_row(kind, [each for each in results if each["kind"] == kind]) for kind in KINDS]
    head = ("recordings", "drawn", "not good", "findings", "99 % ellipsoid holds", "mean square / 6")
    return table(head, [*rows, _row("all", results)])


def _row(name: str, results: list[dict[str, Any]]) -> tuple[object, ...]:
    squares = np.array([square for each in results for square in each["squares"]])
    codes = sorted({code for each in results for code in each["codes"]})
    held = f"{np.mean(squares < chi2.ppf(HOLD, 6)):.1%}" if len(squares) else ""
    mean = f"{squares.mean() / 6:.2f}" if len(squares) else ""
    return label(name), len(results), sum(each["verdict"] != "good" for each in results), ", ".join(codes), held, mean


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
Clean recordings of ten kinds in turn, {len(result["rows"])} of {CELLS} so far, of {SAMPLES[0]} samples and more. Their
noise is unstated. Required: at most 1 % are not good."""
    return f"{about}\n\n{format_table(result['rows'])}"


if __name__ == "__main__":
    run_cells("clean_kinds", sys.argv[1:], CELLS, measure, format_table)
