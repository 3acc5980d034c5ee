"""Captures of cells that run: whether they end good and true, with each fault, and when they are killed.

Every cell is two simulated UR5e, a camera and a ChArUco board with unknown mounts, captured by poses all around. Faults
are those of docs/capture.md at their usual sizes. Arms that ring are sent to places; when the picture was taken after
they arrived is told. Killed captures are resumed and compared with ones that nobody killed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2
from tests.shared.kill_trial import kill_trial
from tests.shared.running_cell import home, running

from basecal.accuracy.verdict import calibrate
from basecal.acquisition.capture import capture, store_plan
from basecal.acquisition.rig import open_rig
from basecal.acquisition.taking import CaptureSettings, Taker
from basecal.cell.files import read_recording
from basecal.errors import BasecalError
from basecal.planning import poses
from basecal.planning.feasible import feasible_in
from basecal.planning.sketch import sketch_of
from basecal.vision.detect import detect
from benchmarks.common import on_one_core, table, write

BASE = "eye_base_from_hand_base"
SPEED_RAD_S = 2.0
EXPECTED = {
    "joint-offsets": {"robot-model"},
    "link-errors": {"robot-model"},
    "backlash": {"robot-model"},
    "sag": {"deflection"},
    "encoder-noise": {"poor-fit"},
    "clock-offset": {"clock-offset"},
    "late-trigger": {"clock-offset"},
    "base-bumped": {"base-moved"},
    "board-remounted": {"base-moved"},
}


class Outcome(NamedTuple):
    """One cell that was captured: `nees` is the base's squared Mahalanobis distance from the truth it had at first."""

    verdict: str
    nees: float
    error_mm: float
    findings: list[str]
    given_up: int


def captured(seed: int, samples: int, *faults: str) -> Outcome:
    """A cell captured and calibrated."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with running(folder, *faults, seed=seed) as world, open_rig(world.cell, folder) as rig:
            sketch = sketch_of(world.cell)
            plan = store_plan(folder, world.cell, poses.plan(sketch, home(world), feasible_in(sketch), samples, seed))
            steps = list(capture(Taker(rig, sketch, folder, CaptureSettings(SPEED_RAD_S)), plan))
        calibration = calibrate(world.cell, detect(world.cell, read_recording(folder, world.cell)))
    findings = [finding.code for finding in calibration.findings if finding.severity != "info"]
    given_up = sum(bool(step.why_not) for step in steps)
    if BASE not in calibration.transforms:
        return Outcome(calibration.verdict, np.nan, np.nan, findings, given_up)
    estimate = calibration.transforms[BASE]
    error = (estimate.mean.inverse() @ world.truth[BASE]).log()
    nees = float(error @ np.linalg.solve(estimate.covariance, error))
    return Outcome(calibration.verdict, nees, 1e3 * float(np.linalg.norm(error[:3])), findings, given_up)


def tried(seed: int, samples: int, *faults: str) -> Outcome:
    """As `captured`; a cell whose arms do not reach, or that cannot be planned, is told as such."""
    try:
        return captured(seed, samples, *faults)
    except BasecalError as error:
        return Outcome(f"failed: {error}", np.nan, np.nan, [], samples)


def row(name: str, outcomes: Sequence[Outcome]) -> list[object]:
    """Of cells alike."""
    verdicts = Counter(each.verdict.split(":")[0] for each in outcomes)
    expected = EXPECTED.get(name, set())
    held = sum(bool(each.nees < chi2.ppf(0.997, 6)) for each in outcomes)
    safe = sum(
        bool(each.nees < chi2.ppf(0.997, 6)) or (each.verdict != "good" and bool(expected & set(each.findings[:1])))
        for each in outcomes
    )
    errors = [each.error_mm for each in outcomes if np.isfinite(each.error_mm)]
    codes = Counter(each.findings[0] for each in outcomes if each.findings)
    first = ", ".join(f"{code} {count}" for code, count in codes.most_common(3))
    within = sum(bool(each.nees < chi2.ppf(0.95, 6)) for each in outcomes)
    error = f"{np.median(errors):.2f}" if errors else "-"
    given_up = sum(each.given_up for each in outcomes)
    return [name or "none", len(outcomes), verdicts["good"], within, held, safe, error, given_up, first]


HEAD = ("fault", "cells", "good", "in 95 %", "in 99.7 %", "in 99.7 % or named first", "error [mm], median",
        "given up", "first finding")  # fmt: skip


def main(words: Sequence[str] | None = None) -> int:
    """Print what came of it, and write it where the run is whole; 1 where a kill lost something."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--faulty", type=int, default=40)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--samples", type=int, default=25)
    asked = parser.parse_args(words)
    on_one_core()
    rows = []
    for name in ("", *EXPECTED, "dropped-frames", "ringing"):
        count = asked.faulty if name else asked.cells
        faults = (name,) if name else ()
        outcomes = [tried(seed, asked.samples, *faults) for seed in range(count)]
        if outcomes:
            rows.append(row(name, outcomes))
            print(rows[-1], flush=True)
    result: dict[str, Any] = {"samples": asked.samples}
    result["rows"] = [dict(zip(HEAD, each, strict=True)) for each in rows]
    lost = 0
    if asked.kills:
        with tempfile.TemporaryDirectory() as folder:
            trial = kill_trial(Path(folder), 12, asked.kills, seed=0)
        result["kills"] = vars(trial)
        lost = trial.lost + trial.twice + (not trial.is_equal)
        print(result["kills"])
    print(table(HEAD, rows))
    if all(getattr(asked, name) == parser.get_default(name) for name in vars(asked)):
        write("capture", result)
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
