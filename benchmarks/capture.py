"""Captures of running cells: whether they end good and true, with each fault, and if they are killed.

Every cell has two simulated UR5e, a camera and a ChArUco board with unknown mounts, captured by poses all around.
Cells with the fault `reflection` have a light with known mounts, shifted from stations. A fault has the size that moves
an answer which ignores it by five of its sigmas, measured on one cell. If still arms hide it, it has its usual size.
Killed captures are resumed and compared with captures that were not killed.

All of it takes hours. With `--keep FILE` outcomes are kept as they come, and a run continues an earlier one, whatever
its commit. `--anew` deletes the kept outcomes first. Results and page are written with the outcomes there are; cells
that were not tried do not count. `--minutes 0` tries nothing more and writes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2
from tests.shared.kill_trial import kill_trial
from tests.shared.running_cell import home

from basecal.accuracy.calibrate import calibrate
from basecal.acquisition.capture import capture, store_plan
from basecal.acquisition.taking import CaptureSettings, Taker
from basecal.cell import Cell, Recording, Sample
from basecal.cell.files import read_recording
from basecal.errors import BasecalError
from basecal.estimation.solve import solve
from basecal.geometry import SE3, Array
from basecal.planning import poses, shifts
from basecal.planning.sketch import sketch_cell
from basecal.simulation.running.faults import FAULTS, read_faults
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.two_arms import two_arms
from basecal.simulation.running.world_file import write_world
from basecal.vision.detect import detect
from benchmarks.common import Kept, commit, table, write
from benchmarks.direct_rig import direct_rig

BASE = "eye_base_from_hand_base"
SPEED_RAD_S = 2.0
SIGMAS = 5.0  # by which a fault moves the base of an answer that ignores it
LEAST_SHIFT = 0.5  # sigmas by which the base moves at the usual size of a fault: below, still arms hide it
SAMPLES = 25
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
    "reflection": {"reflection"},
    "dropped-frames": set[str](),
    "ringing": set[str](),
}


class Outcome(NamedTuple):
    """One captured cell: `nees` is the squared Mahalanobis distance of the base from its initial truth."""

    verdict: str
    nees: float | None
    error_mm: float | None
    findings: list[str]
    given_up: int
    seconds: float


@cache
def plan_samples(seed: int, is_led: bool) -> tuple[Sample, ...]:
    """Poses to which the arms of a cell are sent, whatever its fault."""
    world = two_arms("led" if is_led else "charuco", seed)
    sketch, pattern = sketch_cell(world.cell), shifts if is_led else poses
    return tuple(pattern.plan(sketch, home(world), SAMPLES, seed))


def record_cell(seed: int, fault: str = "") -> tuple[Cell, SE3, Recording, int]:
    """Capture a cell: the cell as stated, its true base, its detected recording, and the number of samples given up."""
    is_led = fault.startswith("reflection")
    world = two_arms("led" if is_led else "charuco", seed, read_faults((fault,) if fault else ()))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_world(world, folder)
        rig = direct_rig(Plant(world, Clock(0)), tuple(world.home))
        plan = store_plan(folder, world.cell, plan_samples(seed, is_led))
        taker = Taker(rig, sketch_cell(world.cell), folder, CaptureSettings(SPEED_RAD_S, 10.0))
        steps = list(capture(taker, plan))
        recording = detect(world.cell, read_recording(folder, world.cell))
    return world.cell, world.truth[BASE], recording, sum(bool(step.why_not) for step in steps)


def capture_cell(seed: int, fault: str = "") -> Outcome:
    """Capture and calibrate a cell; the outcome says if its arms do not reach, or if it cannot be planned."""
    began = time.process_time()
    try:
        cell, truth, recording, given_up = record_cell(seed, fault)
        calibration = calibrate(cell, recording)
    except BasecalError as error:
        return Outcome(f"failed: {error}", None, None, [], SAMPLES, time.process_time() - began)
    findings = [finding.code for finding in calibration.findings if finding.severity != "info"]
    took = time.process_time() - began
    if BASE not in calibration.transforms:
        return Outcome(calibration.verdict, None, None, findings, given_up, took)
    estimate = calibration.transforms[BASE]
    tangent = (estimate.mean.inverse() @ truth).log()
    nees = float(tangent @ np.linalg.solve(estimate.covariance, tangent))
    return Outcome(calibration.verdict, nees, 1e3 * float(np.linalg.norm(tangent[:3])), findings, given_up, took)


@cache
def sound_answer() -> tuple[Cell, SE3, Array]:
    """A cell without a fault, its base by the plain solution, and the covariance of its calibration."""
    cell, _, recording, _ = record_cell(0)
    return cell, solve(cell, recording).state.transforms[BASE], calibrate(cell, recording).transforms[BASE].covariance


def five_sigma(fault: str) -> dict[str, Any]:
    """The size of a fault that moves the base by five sigmas, from the effect of its usual size on a cell.

    The answer that ignores the fault is the plain solution with the robots as stated. Sigmas are those of the
    calibration of the same cell without the fault.
    """
    kind = FAULTS[fault]
    cell, plain, covariance = sound_answer()
    small = 0.1 * kind.default_size if not kind.is_sudden else kind.default_size
    moved = solve(cell, record_cell(0, f"{fault}={small}")[2]).state.transforms[BASE]
    shift = (plain.inverse() @ moved).log()
    sigmas = float(np.sqrt(shift @ np.linalg.solve(covariance, shift)))
    hidden = sigmas < LEAST_SHIFT
    return {"size": kind.default_size if hidden else small * SIGMAS / sigmas, "is_usual": hidden}


def kept_outcomes(kept: Kept, fault: str) -> list[Outcome]:
    """Kept outcomes of a fault, in the order of their seeds."""
    values = {key: value for key, value in kept.items() if key.startswith(f"{fault}#")}
    return [Outcome(*values[key]) for key in sorted(values, key=lambda key: int(key.split("#")[1]))]


HEAD = ("fault", "size", "cells", "good", "in 95 %", "in 99.7 %", "in 99.7 % or named first", "error [mm], median",
        "given up", "first finding")  # fmt: skip


def row(fault: str, size: str, outcomes: Sequence[Outcome]) -> list[object]:
    """A line of the table with `HEAD`, of the outcomes of one fault."""
    verdicts = Counter(each.verdict.split(":")[0] for each in outcomes)
    inside = [each.nees is not None and bool(each.nees < chi2.ppf(0.997, 6)) for each in outcomes]
    named = [each.verdict != "good" and bool(EXPECTED.get(fault, set()) & set(each.findings[:1])) for each in outcomes]
    errors = [each.error_mm for each in outcomes if each.error_mm is not None]
    first = Counter(each.findings[0] for each in outcomes if each.findings).most_common(3)
    return [
        *(fault or "none", size, len(outcomes), verdicts["good"]),
        sum(each.nees is not None and bool(each.nees < chi2.ppf(0.95, 6)) for each in outcomes),
        *(sum(inside), sum(a or b for a, b in zip(inside, named, strict=True))),
        f"{np.median(errors):.2f}" if errors else "-",
        *(sum(each.given_up for each in outcomes), ", ".join(f"{code} {count}" for code, count in first)),
    ]


def size_text(kept: Kept, fault: str) -> str:
    """The size of a fault that is used, with its unit; empty if the fault has none."""
    size = kept.get(f"size:{fault}")
    if size is None:
        return ""
    return f"{size['size']:.3g} {FAULTS[fault].unit}{' (usual)' if size['is_usual'] else ''}"


def try_cells(kept: Kept, faults: Iterable[str], counts: dict[bool, int], end_s: float) -> None:
    """Try cells that are not kept yet, one of each fault in turn, until a time."""
    for seed in range(max(counts.values())):
        for fault in faults:
            if seed >= counts[bool(fault)] or kept.get(f"{fault}#{seed}") is not None:
                continue
            if time.monotonic() > end_s:
                return
            if fault and kept.get(f"size:{fault}") is None:
                usual = fault in ("reflection", "dropped-frames", "ringing")
                size = {"size": FAULTS[fault].default_size, "is_usual": True} if usual else five_sigma(fault)
                kept.keep(f"size:{fault}", size)
            argument = f"{fault}={kept.get(f'size:{fault}')['size']!r}" if fault else ""
            print(fault or "none", seed, kept.keep(f"{fault}#{seed}", capture_cell(seed, argument)), flush=True)


def kill_captures(kept: Kept, required: int, end_s: float) -> dict[str, Any] | None:
    """Sums over captures killed a number of times in all, or until a time; None if none was killed."""
    trials: list[dict[str, Any]] = []
    while sum(each["kills"] for each in trials) < required:
        key = f"killed {len(trials)}"
        if kept.get(key) is None:
            if time.monotonic() > end_s:
                break
            with tempfile.TemporaryDirectory() as folder:
                kept.keep(key, vars(kill_trial(Path(folder), 12, required, seed=len(trials))))
        trials.append(kept.get(key))
    if not trials:
        return None
    sums = {name: sum(each[name] for each in trials) for name in ("kills", "lost", "twice")}
    return {**sums, "captures": len(trials), "is_equal": all(each["is_equal"] for each in trials)}


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    goals, kills = result["wanted"], result["kills"]
    about = f"""\
Simulated cells are captured by {result["samples"]} samples and calibrated. Required:

- {goals["sound"]} cells without a fault: at most 3 % are not good, and 90.5 to 99 % are inside the 95 % ellipsoid.
- {goals["each fault"]} cells of each fault: nine in ten are inside the 99.7 % ellipsoid, or the fault is named first.

A fault has the size that moves the base of a plain answer by {SIGMAS:g} of its sigmas, measured on one cell. If arms at
rest hide the fault, it has its usual size. The table gives the number of cells tried{_since_text(result)}."""
    lines = table(result["rows"][0], [list(each.values()) for each in result["rows"]])
    if kills is None:
        return f"{about}\n\n{lines}"
    equal = "equal" if kills["is_equal"] else "do not equal"
    kill_text = f"""\
{kills["captures"]} captures were killed {kills["kills"]} times (required: {goals["kills"]}) at random instants.
{kills["lost"]} samples were lost, and {kills["twice"]} were requested twice. At the end samples and states {equal}
those of captures that were not killed."""
    return f"{about}\n\n{lines}\n\n{kill_text}"


def _since_text(result: dict[str, Any]) -> str:
    since = result.get("kept_since")
    return f", the first of them with commit {since}" if since not in (None, result["commit"]) else ""


def main(words: Sequence[str] | None = None) -> int:
    """Try, print and write; return 1 if a kill lost or repeated a sample, or changed the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--faulty", type=int, default=40)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--only", nargs="*", choices=("none", *EXPECTED), help="these faults; `none` is without any")
    parser.add_argument("--keep", type=Path, help="file in which outcomes are kept, and from which a run goes on")
    parser.add_argument("--minutes", type=float, default=np.inf, help="begin nothing after so long")
    parser.add_argument("--anew", action="store_true", help="throw away what is kept, as of another state of the code")
    asked = parser.parse_args(words)
    if asked.anew and asked.keep is not None:
        asked.keep.unlink(missing_ok=True)
    kept, end_s = Kept(asked.keep), time.monotonic() + 60 * asked.minutes
    since = kept.get("commit") or kept.keep("commit", commit())
    if since != commit():
        print(f"goes on with outcomes kept since commit {since}; --anew throws them away")
    faults = ["" if each == "none" else each for each in asked.only or ("none", *EXPECTED)]
    try_cells(kept, faults, {False: asked.cells, True: asked.faulty}, end_s)
    kills = kill_captures(kept, asked.kills, end_s)
    rows = [
        row(fault, size_text(kept, fault), outcomes)
        for fault in ("", *EXPECTED)
        if (outcomes := kept_outcomes(kept, fault))
    ]
    print(table(HEAD, rows))
    result = {"samples": SAMPLES, "wanted": {"sound": 200, "each fault": 40, "kills": 200}, "kept_since": since}
    write("capture", {**result, "rows": [dict(zip(HEAD, each, strict=True)) for each in rows], "kills": kills})
    from benchmarks.report import PAGE, make_page

    PAGE.write_text(make_page(), encoding="utf-8")
    return int(kills is not None and bool(kills["lost"] + kills["twice"] + (not kills["is_equal"])))


if __name__ == "__main__":
    sys.exit(main())
