"""Whether `calibrate` names mix-ups of conventions, calls no wrong answer good, and leaves clean cells alone.

Every mix-up of `mutate.py` that applies to a recording is applied to it; a finding must hold its code and names. A
mix-up that leaves the answer within three of its sigmas is harmless and not judged. Pairs that no data can distinguish
are listed here.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
from tests.shared.mutate import Mutation, lines_of, mutations, recording_of
from tests.shared.real_recordings import ROOT, example, moveit_cell, nao_cell

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Cell, Recording, RobotState, Target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.errors import DatasetError, NotConverged
from basecal.kinematics import read_chain
from basecal.kinematics.inverse import inverse
from basecal.simulation import Scenario, simulate
from benchmarks.common import table, write

URDF = ROOT / "tests" / "data" / "urdf" / "six_axis.urdf"
HOME_RAD = np.array([0.4, -1.2, 1.5, -0.6, 1.1, 0.3])
SIGMAS = 3.0
LEAST_NAMED, CLEAN = 0.95, 0.01
GRID = chessboard_target((8, 6), 0.03)

_KINDS: dict[str, tuple[Scenario, int]] = {
    "dual, charuco": (Scenario(), 6),
    "dual, chessboard": (Scenario(target="chessboard"), 3),
    "dual, charuco, robot noise": (Scenario(robot_noise=(3e-4, 5e-4)), 3),
    "dual, charuco, mounts by priors": (Scenario(camera_mount="prior", target_mount="prior"), 3),
    "dual, charuco, lens free": (Scenario(intrinsics="free"), 2),
    "dual, charuco, noise not stated": (Scenario(state_pixel_noise=False), 3),
    "dual in halves": (Scenario(arms="halves"), 2),
    "dual, rigid points": (Scenario(target="points"), 2),
    "dual, 3-D points": (Scenario(target="points3d"), 3),
    "dual, poses": (Scenario(target="pose"), 4),
    "dual, poses, noise not stated": (Scenario(target="pose", state_observation_noise=False), 2),
    "dual, poses of a grid": (Scenario(target="pose", board=GRID), 2),
    "dual, light, its offset free": (Scenario(target="led", camera_mount="fixed"), 2),
    "dual, light, mounts known": (Scenario(target="led", camera_mount="fixed", target_mount="fixed"), 2),
    "dual, light, all free": (Scenario(target="led"), 1),
    "hand-eye, charuco": (Scenario(layout="eye_in_hand"), 2),
    "hand-eye, poses": (Scenario(layout="eye_in_hand", target="pose"), 2),
    "eye-to-hand, charuco": (Scenario(layout="eye_to_hand"), 2),
    "eye-to-hand, light": (Scenario(layout="eye_to_hand", target="led"), 2),
    "dual, hand by joints": (Scenario(), 2),
}
# Recordings and mix-ups that the data cannot distinguish. NAO's head rotates little, and nearly about one axis, so that
# its inverse poses fit as well, and so do two orders of its quaternions.
AMBIGUOUS = {("NAO", name) for name in ("eye inverted", "eye w x y z", "eye y z w x")}


class Trial(NamedTuple):
    """Outcome of one mix-up: `named`, `missed`, or `harmless`; `passed` if a moved base was called good."""

    recording: str
    mutation: str
    row: str
    outcome: str
    passed: bool
    verdict: str
    codes: list[str]
    seconds: float


class Case(NamedTuple):
    """A clean recording."""

    kind: str
    name: str
    cell: Cell
    recording: Recording
    seed: int


def _with_joints(cell: Cell, recording: Recording) -> tuple[Cell, Recording]:
    """The hand as an arm of six joints, with its base moved into reach; samples out of reach are left out."""
    chain = read_chain(URDF, "base_link", "tool0")
    poses = [s.robots["hand"].base_from_flange for s in recording.samples]
    assert poses[0] is not None
    base_from_old_base = chain.forward(HOME_RAD) @ poses[0].inverse()
    samples = []
    for sample, pose in zip(recording.samples, poses, strict=True):
        assert pose is not None
        try:
            joints = inverse(chain, base_from_old_base @ pose, HOME_RAD)
        except NotConverged:
            continue
        samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(joints_rad=joints)}))
    hand = replace(cell.robots["hand"], chain=chain)
    return replace(cell, robots={**cell.robots, "hand": hand}), Recording(tuple(samples))


def _with_shape(cell: Cell, shape: Target) -> Cell:
    return replace(cell, targets={n: replace(t, target=shape) for n, t in cell.targets.items()})


def simulated_cases() -> Iterator[Case]:
    """Fifty cells of various kinds."""
    for kind, (scenario, count) in _KINDS.items():
        for seed in range(count):
            drawn = simulate(replace(scenario, samples=18 + 4 * (seed % 4)), 100 + seed)
            cell, recording = drawn.cell, drawn.recording
            if "joints" in kind:
                cell, recording = _with_joints(cell, recording)
            if "grid" in kind:
                cell = _with_shape(cell, GRID)
            yield Case(kind, f"{kind}, seed {100 + seed}", cell, recording, 100 + seed)


def real_cases() -> Iterator[Case]:
    """The clean real recordings; those that are missing are left out with a message."""
    readers: dict[str, Callable[[], tuple[Cell, Recording]]] = {
        "UR5e": lambda: example("ur5e_dual"),
        "RCT": lambda: example("rct_charuco"),
        "NAO": nao_cell,
        "MoveIt": moveit_cell,
    }
    for name, read in readers.items():
        try:
            yield Case(name, name, *read(), 0)
        except DatasetError as error:
            print(f"left out: {error}")


def _has_moved(cell: Cell, clean: Calibration, mutated: Calibration) -> bool:
    """Whether any requested transform is missing, or more than three of its sigmas from the clean answer."""
    for name in cell.requested_transforms:
        if name not in clean.transforms:
            continue
        if name not in mutated.transforms:
            return True
        distance = np.abs((clean[name].mean.inverse() @ mutated[name].mean).log())
        variance = np.diag(clean[name].covariance) + np.diag(mutated[name].covariance)
        if np.any(distance > SIGMAS * np.sqrt(np.maximum(variance, 1e-18))):
            return True
    return False


def is_named(case: Case, mutation: Mutation, calibration: Calibration) -> bool:
    """Whether a finding holds the code and the names of the mix-up, or of one that is exactly exchangeable."""
    if (case.kind, mutation.name) in AMBIGUOUS:
        return any(f.code == "ambiguous-convention" and mutation.code in f.message for f in calibration.findings)
    for finding in calibration.findings:
        if finding.code == mutation.code and set(mutation.about) <= set(finding.about):
            return True
        if finding.code in mutation.partners:
            return True
    return False


def trial(case: Case, clean: Calibration, mutation: Mutation) -> Trial:
    """Calibrate one mix-up."""
    recording = recording_of(mutation.lines(lines_of(case.recording)), mutation.cell)
    began = time.process_time()
    calibration = calibrate(mutation.cell, recording)
    took = time.process_time() - began
    has_moved = _has_moved(case.cell, clean, calibration)
    named = is_named(case, mutation, calibration)
    outcome = "named" if named else "missed" if has_moved else "harmless"
    codes = [f.code for f in calibration.findings if f.severity != "info"]
    passed = has_moved and calibration.verdict == "good"
    return Trial(case.name, mutation.name, mutation.row, outcome, passed, calibration.verdict, codes, took)


def measure_case(case: Case) -> tuple[dict[str, Any], list[Trial]]:
    """The verdict on the clean recording, and trials of all its mix-ups."""
    calibration = calibrate(case.cell, case.recording)
    codes = [f.code for f in calibration.findings if f.severity != "info"]
    clean = {"recording": case.name, "kind": case.kind, "simulated": case.kind in _KINDS}
    clean |= {"verdict": calibration.verdict, "codes": codes}
    mix_ups = mutations(case.cell, lines_of(case.recording), case.seed)
    return clean, [trial(case, calibration, mutation) for mutation in mix_ups]


def run(cases: list[Case], workers: int) -> tuple[list[dict[str, Any]], list[Trial]]:
    """Clean verdicts and all trials, printed as they come."""
    clean, trials = [], []
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for verdict, trials_of_case in pool.map(measure_case, cases):
            clean.append(verdict)
            trials += trials_of_case
            print(f"{verdict['recording']}: {verdict['verdict']} {verdict['codes'] or ''}", flush=True)
            for each in trials_of_case:
                if each.outcome != "named" or each.passed:
                    codes = ", ".join(sorted(set(each.codes)))
                    print(
                        f"  {each.outcome}: {each.mutation}: {each.verdict} ({codes}) {each.seconds:.1f} s", flush=True
                    )
    return clean, trials


def summary(trials: list[Trial]) -> list[dict[str, Any]]:
    """Counts by row of the table of mutations, and over all."""
    out = []
    for row in [*dict.fromkeys(t.row for t in trials), "all"]:
        chosen = [t for t in trials if row in (t.row, "all")]
        count = {outcome: sum(t.outcome == outcome for t in chosen) for outcome in ("named", "missed", "harmless")}
        judged = count["named"] + count["missed"]
        rate = count["named"] / judged if judged else None
        seconds = float(np.median([t.seconds for t in chosen]))
        out.append({"row": row, **count, "rate": rate, "passed": sum(t.passed for t in chosen), "median_s": seconds})
    return out


HEAD = ("mix-up", "named", "missed", "harmless", "rate", "good though moved", "CPU time, median [s]")


def row(counts_of_row: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    rate = "" if counts_of_row["rate"] is None else f"{100 * counts_of_row['rate']:.1f} %"
    counts = (str(counts_of_row[key]) for key in ("named", "missed", "harmless"))
    return counts_of_row["row"], *counts, rate, str(counts_of_row["passed"]), f"{counts_of_row['median_s']:.2f}"


def main(arguments: list[str]) -> None:
    """Run, print; the whole run also writes results/mutations.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutations", description=__doc__)
    parser.add_argument("--only", nargs="*", default=["real", "simulated"], choices=["real", "simulated"])
    parser.add_argument("--kinds", nargs="*", default=[], metavar="KIND", help="kinds of cells")
    parser.add_argument("--cells", type=int, default=None, help="at most so many of each kind")
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args(arguments)
    began = time.perf_counter()
    cases = [case for name in asked.only for case in {"real": real_cases, "simulated": simulated_cases}[name]()]
    cases = [c for c in cases if not asked.kinds or c.kind in asked.kinds]
    clean, trials = run([c for c in cases if asked.cells is None or c.seed % 100 < asked.cells], asked.workers)
    rows = summary(trials)
    print("\n" + table(HEAD, map(row, rows)))
    verdicts = [c for c in clean if c["simulated"]]
    bad = [c for c in verdicts if c["verdict"] != "good"]
    print(f"\nclean simulated cells not good: {len(bad)} of {len(verdicts)}; {time.perf_counter() - began:.0f} s")
    if not asked.kinds and asked.cells is None and len(asked.only) == 2:
        trial_fields = [t._asdict() for t in trials]
        write("mutations", {"clean": clean, "asked": LEAST_NAMED, "summary": rows, "trials": trial_fields})


if __name__ == "__main__":
    main(sys.argv[1:])
