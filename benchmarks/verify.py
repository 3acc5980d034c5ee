"""Whether new samples show that something moved, and raise no alarm if nothing moved.

Simulated: cells of two arms are calibrated from 25 samples and checked with one to six more. `still`: nothing moved,
and alarms are false. `detectable`: the hand's base is shifted in a random direction by the length that the check calls
detectable. `named`: it is shifted by three times that, and the moved part must be named first from four samples on.

Real: recordings are divided at random into halves. One half is calibrated, and all or six samples of the other are
checked. Then a mount is shifted by the larger of 2 mm and twice the detectable length.
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
LEAST_NAMED = 0.95
LEAST_UNCHANGED = 0.95
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


def shift_transform(cell: Cell, recording: Recording, transform: str, tangent: Array) -> Recording:
    """The recording after one transform moved: recorded poses of a robot are in another base."""
    step = SE3.exp(tangent)
    samples = []
    for sample in recording.samples:
        robots = dict(sample.robots)
        for name, state in robots.items():
            pose = state.base_from_flange
            if pose is not None and transform == cell.base_name(name):
                robots[name] = RobotState(step.inverse() @ pose)
        samples.append(replace(sample, robots=robots))
    return Recording(tuple(samples), recording.findings, recording.folder)


def direction(seed: int) -> Array:
    """A shift of length 1 in a random direction by the seed, as a tangent."""
    vector = np.random.default_rng(seed).standard_normal(3)
    return np.array([*(vector / np.linalg.norm(vector)), 0.0, 0.0, 0.0])


def simulated_trial(seed: int, is_shifted: bool = True) -> dict[str, Any] | None:
    """Whether there was an alarm, a shift was seen, and the base named; None if the calibration is refused."""
    new = 1 + seed % MOST_NEW
    stated = seed // MOST_NEW % 2 == 0
    noise = {"robot_noise": (1e-4, 2e-4), "state_robot_noise": stated, "state_pixel_noise": stated}
    drawn = simulate(Scenario(samples=CALIBRATED + new, **noise), 7000 + seed)
    samples = drawn.recording.samples
    calibration = calibrate(drawn.cell, Recording(samples[:CALIBRATED]))
    if calibration.verdict == "refused":
        return None
    later = Recording(samples[CALIBRATED:])
    still = verify(drawn.cell, calibration, later)
    length = still.detectable_m
    if length is None or not is_shifted:
        return {"new": new, "alarm": bool(still.moved), "detectable_m": length, "seen": None, "named": None}
    seen, far = (
        verify(drawn.cell, calibration, shift_transform(drawn.cell, later, BASE, factor * length * direction(seed)))
        for factor in (1.0, 3.0)
    )
    named = bool(far.moved) and far.shift is not None and far.shift.frame == FRAME
    return {"new": new, "alarm": bool(still.moved), "detectable_m": length, "seen": bool(seen.moved), "named": named}


def divided_trial(cell: Cell, recording: Recording, seed: int) -> dict[str, dict[str, Any]] | None:
    """Results of one division by the samples that are checked; None if the calibration of the first half is refused."""
    order = np.random.default_rng(seed).permutation(len(recording.samples))
    half = len(order) // 2
    first, second = (Recording(tuple(recording.samples[k] for k in sorted(part))) for part in np.split(order, [half]))
    calibration = calibrate(cell, first)
    if calibration.verdict == "refused":
        return None
    return {
        name: _check_half(cell, calibration, Recording(second.samples[:most]), seed) for name, most in CHECKED.items()
    }


def _check_half(cell: Cell, calibration: Calibration, later: Recording, seed: int) -> dict[str, Any]:
    """Whether something moved, and whether a shifted mount is named."""
    still = verify(cell, calibration, later)
    if still.moved is None or still.detectable_m is None:
        return {"moved": still.moved, "detectable_m": None, "named": None}
    length = max(LEAST_SHIFT_M, 2 * still.detectable_m)
    transform, far = _verify_shifted_mount(cell, calibration, later, length * direction(seed))
    frames = [] if far.shift is None else [far.shift.transform, *(other.transform for other in far.alternatives)]
    return {
        "moved": still.moved,
        "detectable_m": still.detectable_m,
        "named": bool(far.moved) and transform in frames,
    }


def _verify_shifted_mount(
    cell: Cell, calibration: Calibration, later: Recording, tangent: Array
) -> tuple[str, Verification]:
    """Verify with a calibration whose mount, or base, is shifted, as if it had since moved by the opposite."""
    names = [name for name in cell.requested_transforms if name in calibration.transforms]
    target = next(iter(cell.targets.values()))
    name = cell.mount_name(target.name) if target.on == WORLD or len(names) > 1 else names[0]
    name = name if name in calibration.transforms else names[0]
    estimate = calibration[name]
    transforms = {**calibration.transforms, name: replace(estimate, mean=estimate.mean @ SE3.exp(tangent))}
    return name, verify(cell, replace(calibration, transforms=transforms), later)


def summary(trials: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Statistics over simulated cells."""
    with_shift = [f for f in trials if f["seen"] is not None]
    named = [f["named"] for f in with_shift if f["new"] >= FEWEST_NAMED]
    return {
        "still": len(trials),
        "alarms": sum(f["alarm"] for f in trials),
        "seen": float(np.mean([f["seen"] for f in with_shift])),
        "shifted": len(with_shift),
        "named": float(np.mean(named)) if named else None,
        "detectable_m": float(np.median([f["detectable_m"] for f in with_shift])),
    }


def summary_real(name: str, checked: str, trials: Sequence[dict[str, Any] | None]) -> dict[str, Any]:
    """Statistics over divisions of a recording; refused ones are None."""
    checks = [f[checked] for f in trials if f is not None]
    named = [f["named"] for f in checks if f["named"] is not None]
    lengths = [f["detectable_m"] for f in checks if f["detectable_m"] is not None]
    return {
        "recording": name,
        "checked": checked,
        "splittings": len(trials),
        "refused": trials.count(None),
        "untold": sum(f["moved"] is None for f in checks),
        "alarms": sum(f["moved"] is True for f in checks),
        "still": sum(f["moved"] is False for f in checks),
        "named": float(np.mean(named)) if named else None,
        "detectable_m": float(np.median(lengths)) if lengths else None,
    }


def row(name: str, statistics: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    alarms = (
        f"{statistics['alarms']} of {statistics['still']} ({100 * statistics['alarms'] / statistics['still']:.1f} %)"
    )
    return (
        name,
        alarms,
        statistics["shifted"],
        _percent(statistics["seen"]),
        _percent(statistics["named"]),
        f"{1e3 * statistics['detectable_m']:.2f}",
    )


def row_real(statistics: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD_REAL`."""
    length = "" if statistics["detectable_m"] is None else f"{1e3 * statistics['detectable_m']:.2f}"
    decided = statistics["still"] + statistics["alarms"]
    shares = (
        statistics["still"] / max(decided + statistics["untold"], 1),
        statistics["still"] / decided if decided else None,
        statistics["named"],
    )
    counts = (statistics["splittings"], statistics["refused"], statistics["untold"], statistics["alarms"])
    return statistics["recording"], statistics["checked"], *counts, *map(_percent, shares), length


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.1f} %"


def main(arguments: list[str]) -> None:
    """Draw and print; write results/verify.json too if all is measured, or with --keep, for what there is."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.verify", description=__doc__)
    parser.add_argument("--cells", type=int, default=CELLS, help="simulated and shifted")
    parser.add_argument("--still", type=int, default=STILL_CELLS, help="simulated, those that are shifted among them")
    parser.add_argument("--splittings", type=int, default=SPLITTINGS, help="of each real recording")
    parser.add_argument("--recordings", nargs="*", default=list(REAL), choices=list(recordings()), metavar="NAME")
    parser.add_argument("--keep", type=Path, help="file in which outcomes are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept = Kept(asked.keep)
    trials = [
        f
        for seed in range(asked.still)
        if (f := kept.of(f"#{seed}", partial(simulated_trial, seed, seed < asked.cells)))
    ]
    parts = {"1 to 6": trials} | {
        text: [f for f in trials if low <= f["new"] <= high] for text, low, high in (("1", 1, 1), ("4 to 6", 4, 6))
    }
    rows = {name: summary(part) for name, part in parts.items() if part}
    print(table(HEAD, [row(name, statistics) for name, statistics in rows.items()]), flush=True)
    real_rows = [each for name in asked.recordings for each in _real_rows(name, asked.splittings, kept)]
    print(table(HEAD_REAL, map(row_real, real_rows)), flush=True)
    if asked.keep is not None or (asked.still >= STILL_CELLS and asked.splittings >= SPLITTINGS):
        write("verify", {"level": MOVED_LEVEL, "power": POWER, "rows": rows, "real": real_rows})


def _real_rows(name: str, splittings: int, kept: Kept) -> list[dict[str, Any]]:
    try:
        cell, recording = recordings()[name]()
    except DatasetError as error:
        print(f"left out: {error}", file=sys.stderr)
        return []
    trials = [kept.of(f"{name}#{seed}", partial(divided_trial, cell, recording, seed)) for seed in range(splittings)]
    return [summary_real(name, checked, trials) for checked in CHECKED] if trials else []


if __name__ == "__main__":
    main(sys.argv[1:])
