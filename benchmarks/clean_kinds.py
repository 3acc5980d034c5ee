"""Clean recordings of ten kinds, with noise that nobody states: how many are not good, and how well ellipsoids hold.

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
from benchmarks.common import cell_by_cell, label, table

CELLS, HOLD = 600, 0.99
SAMPLES = (16, 30)  # of a recording, at least and at most
TOUCH_M = 2e-4  # sigma of a touch
UNSTATED: dict[str, Any] = {
    "robot_noise": (1e-4, 2e-4),
    "state_robot_noise": False,
    "state_pixel_noise": False,
    "state_observation_noise": False,
}


def scenario(seed: int, **given: Any) -> dict[str, Any]:
    """The verdict on a simulated cell of usual noise, and squared errors of its free transforms in sigmas."""
    samples = int(np.random.default_rng([seed, 41]).integers(*SAMPLES))
    made = simulate(Scenario(samples=samples, **{**UNSTATED, **given}), seed)
    return _outcome(calibrate(made.cell, made.recording), made.truth)


def pnp_poses(seed: int) -> dict[str, Any]:
    """Likewise of poses of a tag or of corners by PnP."""
    points = list(target_poses.TARGETS.values())[seed // len(KINDS) % len(target_poses.TARGETS)]
    found = target_poses.trial(seed, SAMPLES[0] + 4, points)
    return {"verdict": found["verdict"], "codes": found["codes"], "squares": [found["square"]]}


def touches(seed: int) -> dict[str, Any]:
    """Likewise of touches of marks by the tips of two arms."""
    cell = touch_cell()
    lines = touch_lines(np.random.default_rng(seed), SAMPLES[1], TOUCH_M)
    return _outcome(calibrate(cell, recorded(cell, lines)), {BASE: TRUTH})


def _outcome(found: Calibration, truth: dict[str, SE3]) -> dict[str, Any]:
    squares = []
    for name, estimate in found.transforms.items():
        if name in truth and np.linalg.matrix_rank(estimate.covariance, hermitian=True) == 6:
            off = (estimate.mean.inverse() @ truth[name]).log()
            squares.append(float(off @ np.linalg.solve(estimate.covariance, off)))
    codes = sorted({finding.code for finding in found.findings if finding.severity != "info"})
    return {"verdict": found.verdict, "codes": codes, "squares": squares}


KINDS: dict[str, Callable[[int], dict[str, Any]]] = {
    "two arms, pixels of a board": scenario,
    "two arms, 3-D points": partial(scenario, target="points3d"),
    "two arms, a light": partial(scenario, target="led"),
    "two arms, one still in turn": partial(scenario, arms="halves"),
    "two arms, joints": partial(scenario, joints=True),
    "three arms in a ring": partial(scenario, layout="ring", robots=3),
    "one arm, camera on it": partial(scenario, layout="eye_in_hand"),
    "one arm, camera beside it": partial(scenario, layout="eye_to_hand"),
    "one arm, poses by PnP": pnp_poses,
    "two arms, touches": touches,
}


def measured(seed: int) -> Iterator[dict[str, Any]]:
    """The outcome of a recording of the kind whose turn it is."""
    kind = list(KINDS)[seed % len(KINDS)]
    yield {"seed": seed, "kind": kind, **KINDS[kind](seed)}


def shown(found: list[dict[str, Any]]) -> str:
    """A row for each kind, and all."""
    rows = [_row(kind, [each for each in found if each["kind"] == kind]) for kind in KINDS]
    head = ("recordings", "drawn", "not good", "findings", "99 % ellipsoid holds", "mean square / 6")
    return table(head, [*rows, _row("all", found)])


def _row(name: str, found: list[dict[str, Any]]) -> tuple[object, ...]:
    squares = np.array([square for each in found for square in each["squares"]])
    codes = sorted({code for each in found for code in each["codes"]})
    held = f"{np.mean(squares < chi2.ppf(HOLD, 6)):.1%}" if len(squares) else ""
    mean = f"{squares.mean() / 6:.2f}" if len(squares) else ""
    return label(name), len(found), sum(each["verdict"] != "good" for each in found), ", ".join(codes), held, mean


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
Clean recordings of ten kinds in turn, {len(result["rows"])} of {CELLS} so far, of {SAMPLES[0]} samples and more. Their
noise is unstated. Required: at most 1 % are not good."""
    return f"{about}\n\n{shown(result['rows'])}"


if __name__ == "__main__":
    cell_by_cell("clean_kinds", sys.argv[1:], CELLS, measured, shown)
