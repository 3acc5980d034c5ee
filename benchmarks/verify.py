"""Whether new samples tell that something moved, and say nothing where nothing did.

Simulated: cells of two arms, calibrated from 25 samples, checked with one to six more. `still`: nothing moved, alarms
are false. `detectable`: the hand's base is shifted, in any direction, by the length that the check says it would see.
`named`: by three times that, with four samples and more; what moved is to be named first. Real: recordings halved at
random, one half calibrated, the other checked, all of it or its first six samples; then the same with a mount shifted
by the larger of 2 mm and twice the detectable length.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.drift.verify import POWER, Verification, verify
from basecal.accuracy.model_comparison.nested_models import MOVED_LEVEL
from basecal.cell import WORLD, Calibration, Cell, Recording, RobotState
from basecal.errors import DatasetError
from basecal.geometry import SE3, Array
from basecal.simulation import Scenario, simulate
from benchmarks.calibrate import recordings
from benchmarks.common import Kept, on_one_core, table, write

BASE, FRAME = "eye_base_from_hand_base", "hand_base"
CALIBRATED, MOST_NEW, FEWEST_NAMED = 25, 6, 4
CELLS = 500
STILL_CELLS = 1000  # in which nothing moved, those that are shifted among them
SPLITTINGS = 100
REAL = (
    "rct_charuco",
    "rct_10x10",
    "visp_franka_in_hand",
    "visp_franka_to_hand",
    "moveit_pose_samples",
    "ur5e_dual",
    "kuka_1_chessboard",
    "nao_dual_axbycz",
    "ur3e_88_images",
    "motoman_dual_joints",
)
CHECKED = {"the other half": None, f"{MOST_NEW} samples": MOST_NEW}
LEAST_SHIFT_M = 2e-3
MOST_ALARMS = 0.01
LOW, HIGH = 0.92, 0.98
NAMED = 0.95
AS_CALIBRATED = 0.95
HEAD = ("samples", "false alarms", "shifted", "detectable shift seen", "first named at three times it", "median [mm]")
HEAD_REAL = (
    "recording",
    "checked",
    "splittings",
    "refused",
    "undecided",
    "alarms",
    "no change reported",
    "of those decided",
    "shifts named, alone or among",
    "median [mm]",
)


def shifted(cell: Cell, recording: Recording, transform: str, tangent: Array) -> Recording:
    """A recording of a cell of which one transform moved: what a robot recorded is of another base, or flange."""
    back = SE3.exp(tangent)
    samples = []
    for sample in recording.samples:
        robots = dict(sample.robots)
        for name, state in robots.items():
            pose = state.base_from_flange
            if pose is not None and transform == cell.base_name(name):
                robots[name] = RobotState(back.inverse() @ pose)
        samples.append(replace(sample, robots=robots))
    return Recording(tuple(samples), recording.findings, recording.folder)


def direction(seed: int) -> Array:
    """A shift of length 1 in a direction that the seed draws, as a tangent."""
    along = np.random.default_rng(seed).standard_normal(3)
    return np.array([*(along / np.linalg.norm(along)), 0.0, 0.0, 0.0])


def simulated(seed: int, is_shifted: bool = True) -> dict[str, Any] | None:
    """One cell: whether there was an alarm, a shift was seen, and the base named; None where nothing was calibrated."""
    new = 1 + seed % MOST_NEW
    stated = seed // MOST_NEW % 2 == 0
    noise = {"robot_noise": (1e-4, 2e-4), "state_robot_noise": stated, "state_pixel_noise": stated}
    made = simulate(Scenario(samples=CALIBRATED + new, **noise), 7000 + seed)
    taken = made.recording.samples
    calibration = calibrate(made.cell, Recording(taken[:CALIBRATED]))
    if calibration.verdict == "refused":
        return None
    later = Recording(taken[CALIBRATED:])
    still = verify(made.cell, calibration, later)
    length = still.detectable_m
    if length is None or not is_shifted:
        return {"new": new, "alarm": bool(still.moved), "detectable_m": length, "seen": None, "named": None}
    seen, far = (
        verify(made.cell, calibration, shifted(made.cell, later, BASE, factor * length * direction(seed)))
        for factor in (1.0, 3.0)
    )
    named = bool(far.moved) and far.shift is not None and far.shift.frame == FRAME
    return {"new": new, "alarm": bool(still.moved), "detectable_m": length, "seen": bool(seen.moved), "named": named}


def halved(cell: Cell, recording: Recording, seed: int) -> dict[str, dict[str, Any]] | None:
    """One splitting, by what was checked; None where the calibration of the first half is refused."""
    order = np.random.default_rng(seed).permutation(len(recording.samples))
    half = len(order) // 2
    first, second = (Recording(tuple(recording.samples[k] for k in sorted(part))) for part in np.split(order, [half]))
    calibration = calibrate(cell, first)
    if calibration.verdict == "refused":
        return None
    return {name: _checked(cell, calibration, Recording(second.samples[:most]), seed) for name, most in CHECKED.items()}


def _checked(cell: Cell, calibration: Calibration, later: Recording, seed: int) -> dict[str, Any]:
    """Whether samples are as calibrated, and whether a mount that is shifted is named."""
    still = verify(cell, calibration, later)
    if still.moved is None or still.detectable_m is None:
        return {"moved": still.moved, "detectable_m": None, "named": None}
    length = max(LEAST_SHIFT_M, 2 * still.detectable_m)
    transform, far = _moved_mount(cell, calibration, later, length * direction(seed))
    frames = [] if far.shift is None else [far.shift.transform, *(other.transform for other in far.alternatives)]
    return {
        "moved": still.moved,
        "detectable_m": still.detectable_m,
        "named": bool(far.moved) and transform in frames,
    }


def _moved_mount(cell: Cell, calibration: Calibration, later: Recording, tangent: Array) -> tuple[str, Verification]:
    """A calibration whose mount, or base, is so far off: as if that had moved since, by the opposite."""
    asked = [name for name in cell.requested_transforms if name in calibration.transforms]
    target = next(iter(cell.targets.values()))
    name = cell.mount_name(target.name) if target.on == WORLD or len(asked) > 1 else asked[0]
    name = name if name in calibration.transforms else asked[0]
    estimate = calibration[name]
    moved = {**calibration.transforms, name: replace(estimate, mean=estimate.mean @ SE3.exp(tangent))}
    return name, verify(cell, replace(calibration, transforms=moved), later)


def summary(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Shares over simulated cells."""
    told = [f for f in found if f["seen"] is not None]
    many = [f["named"] for f in told if f["new"] >= FEWEST_NAMED]
    return {
        "still": len(found),
        "alarms": sum(f["alarm"] for f in found),
        "seen": float(np.mean([f["seen"] for f in told])),
        "shifted": len(told),
        "named": float(np.mean(many)) if many else None,
        "detectable_m": float(np.median([f["detectable_m"] for f in told])),
    }


def summary_real(name: str, checked: str, found: Sequence[dict[str, Any] | None]) -> dict[str, Any]:
    """Of splittings of a recording, None those that were refused."""
    told = [f[checked] for f in found if f is not None]
    named = [f["named"] for f in told if f["named"] is not None]
    lengths = [f["detectable_m"] for f in told if f["detectable_m"] is not None]
    return {
        "recording": name,
        "checked": checked,
        "splittings": len(found),
        "refused": found.count(None),
        "untold": sum(f["moved"] is None for f in told),
        "alarms": sum(f["moved"] is True for f in told),
        "still": sum(f["moved"] is False for f in told),
        "named": float(np.mean(named)) if named else None,
        "detectable_m": float(np.median(lengths)) if lengths else None,
    }


def row(name: str, of: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    alarms = f"{of['alarms']} of {of['still']} ({100 * of['alarms'] / of['still']:.1f} %)"
    return name, alarms, of["shifted"], _percent(of["seen"]), _percent(of["named"]), f"{1e3 * of['detectable_m']:.2f}"


def row_real(of: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD_REAL`."""
    length = "" if of["detectable_m"] is None else f"{1e3 * of['detectable_m']:.2f}"
    told = of["still"] + of["alarms"]
    shares = (of["still"] / max(told + of["untold"], 1), of["still"] / told if told else None, of["named"])
    counts = (of["splittings"], of["refused"], of["untold"], of["alarms"])
    return of["recording"], of["checked"], *counts, *map(_percent, shares), length


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.1f} %"


def main(arguments: list[str]) -> None:
    """Draw and print; results/verify.json too where all of it, or with --keep what of it there is, was measured."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.verify", description=__doc__)
    parser.add_argument("--cells", type=int, default=CELLS, help="simulated and shifted")
    parser.add_argument("--still", type=int, default=STILL_CELLS, help="simulated, those that are shifted among them")
    parser.add_argument("--splittings", type=int, default=SPLITTINGS, help="of each real recording")
    parser.add_argument("--recordings", nargs="*", default=list(REAL), choices=list(recordings()), metavar="NAME")
    parser.add_argument("--keep", type=Path, help="file in which outcomes are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept = Kept(asked.keep)
    drawn = [
        f for seed in range(asked.still) if (f := kept.of(f"#{seed}", partial(simulated, seed, seed < asked.cells)))
    ]
    parts = {"1 to 6": drawn} | {
        text: [f for f in drawn if low <= f["new"] <= high] for text, low, high in (("1", 1, 1), ("4 to 6", 4, 6))
    }
    rows = {name: summary(part) for name, part in parts.items() if part}
    print(table(HEAD, [row(name, of) for name, of in rows.items()]), flush=True)
    real_rows = [each for name in asked.recordings for each in _real(name, asked.splittings, kept)]
    print(table(HEAD_REAL, map(row_real, real_rows)), flush=True)
    if asked.keep is not None or (asked.still >= STILL_CELLS and asked.splittings >= SPLITTINGS):
        write("verify", {"level": MOVED_LEVEL, "power": POWER, "rows": rows, "real": real_rows})


def _real(name: str, splittings: int, kept: Kept) -> list[dict[str, Any]]:
    try:
        cell, recording = recordings()[name]()
    except DatasetError as error:
        print(f"left out: {error}", file=sys.stderr)
        return []
    found = [kept.of(f"{name}#{seed}", partial(halved, cell, recording, seed)) for seed in range(splittings)]
    return [summary_real(name, checked, found) for checked in CHECKED] if found else []


if __name__ == "__main__":
    main(sys.argv[1:])
