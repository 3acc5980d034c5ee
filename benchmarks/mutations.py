"""Whether `calibrate` names what is mixed up, lets nothing wrong pass for good, and leaves clean cells alone.

Every mix-up of `mutate.py` that a recording can suffer is done to it; a finding must hold its code and names. One that
leaves the answer within three of its sigmas is harmless and not judged. Which pairs no data can tell is stated here.
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
HOME = np.array([0.4, -1.2, 1.5, -0.6, 1.1, 0.3])
SIGMAS = 3.0
NAMED, CLEAN = 0.95, 0.01
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
# Pairs of recording and mix-up that the data cannot tell: NAO's head turns so little, and about so nearly one axis,
# that its poses inverted fit as well, and so do two orders of their quaternions.
AMBIGUOUS = {("NAO", name) for name in ("eye inverted", "eye w x y z", "eye y z w x")}


class Trial(NamedTuple):
    """What became of one mix-up: `named`, `missed`, or `harmless`; `passed` where a moved base was called good."""

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


def _by_joints(cell: Cell, recording: Recording) -> tuple[Cell, Recording]:
    """The hand as an arm of six joints, its base moved so that it reaches; what it cannot reach is left out."""
    chain = read_chain(URDF, "base_link", "tool0")
    poses = [s.robots["hand"].base_from_flange for s in recording.samples]
    assert poses[0] is not None
    base_from_old_base = chain.forward(HOME) @ poses[0].inverse()
    samples = []
    for sample, pose in zip(recording.samples, poses, strict=True):
        assert pose is not None
        try:
            joints = inverse(chain, base_from_old_base @ pose, HOME)
        except NotConverged:
            continue
        samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(joints_rad=joints)}))
    hand = replace(cell.robots["hand"], chain=chain)
    return replace(cell, robots={**cell.robots, "hand": hand}), Recording(tuple(samples))


def _with_shape(cell: Cell, shape: Target) -> Cell:
    return replace(cell, targets={n: replace(t, target=shape) for n, t in cell.targets.items()})


def simulated() -> Iterator[Case]:
    """Fifty cells of various kinds."""
    for kind, (scenario, count) in _KINDS.items():
        for seed in range(count):
            made = simulate(replace(scenario, samples=18 + 4 * (seed % 4)), 100 + seed)
            cell, recording = made.cell, made.recording
            if "joints" in kind:
                cell, recording = _by_joints(cell, recording)
            if "grid" in kind:
                cell = _with_shape(cell, GRID)
            yield Case(kind, f"{kind}, seed {100 + seed}", cell, recording, 100 + seed)


def real() -> Iterator[Case]:
    """The clean real recordings; those that are not here are left out, and it is said."""
    made: dict[str, Callable[[], tuple[Cell, Recording]]] = {
        "UR5e": lambda: example("ur5e_dual"),
        "RCT": lambda: example("rct_charuco"),
        "NAO": nao_cell,
        "MoveIt": moveit_cell,
    }
    for name, read in made.items():
        try:
            yield Case(name, name, *read(), 0)
        except DatasetError as error:
            print(f"left out: {error}")


def _moved(cell: Cell, clean: Calibration, other: Calibration) -> bool:
    """Whether anything asked is more than three of its sigmas from the clean answer, or missing."""
    for name in cell.requested_transforms:
        if name not in clean.transforms:
            continue
        if name not in other.transforms:
            return True
        off = np.abs((clean[name].mean.inverse() @ other[name].mean).log())
        variance = np.diag(clean[name].covariance) + np.diag(other[name].covariance)
        if np.any(off > SIGMAS * np.sqrt(np.maximum(variance, 1e-18))):
            return True
    return False


def is_named(case: Case, mutation: Mutation, found: Calibration) -> bool:
    """Whether a finding holds the code and the names of the mix-up, or of one that is exactly exchangeable."""
    if (case.kind, mutation.name) in AMBIGUOUS:
        return any(f.code == "ambiguous-convention" and mutation.code in f.message for f in found.findings)
    for finding in found.findings:
        if finding.code == mutation.code and set(mutation.about) <= set(finding.about):
            return True
        if finding.code in mutation.partners:
            return True
    return False


def trial(case: Case, clean: Calibration, mutation: Mutation) -> Trial:
    """One mix-up, calibrated."""
    recording = recording_of(mutation.lines(lines_of(case.recording)), mutation.cell)
    began = time.process_time()
    found = calibrate(mutation.cell, recording)
    took = time.process_time() - began
    moved = _moved(case.cell, clean, found)
    named = is_named(case, mutation, found)
    outcome = "named" if named else "missed" if moved else "harmless"
    codes = [f.code for f in found.findings if f.severity != "info"]
    passed = moved and found.verdict == "good"
    return Trial(case.name, mutation.name, mutation.row, outcome, passed, found.verdict, codes, took)


def of_case(case: Case) -> tuple[dict[str, Any], list[Trial]]:
    """The verdict on the clean recording, and all mix-ups done to it."""
    found = calibrate(case.cell, case.recording)
    codes = [f.code for f in found.findings if f.severity != "info"]
    clean = {"recording": case.name, "kind": case.kind, "simulated": case.kind in _KINDS}
    clean |= {"verdict": found.verdict, "codes": codes}
    mixed = mutations(case.cell, lines_of(case.recording), case.seed)
    return clean, [trial(case, found, mutation) for mutation in mixed]


def run(cases: list[Case], workers: int) -> tuple[list[dict[str, Any]], list[Trial]]:
    """Clean verdicts, and all trials, told as they come."""
    clean, trials = [], []
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for told, of in pool.map(of_case, cases):
            clean.append(told)
            trials += of
            print(f"{told['recording']}: {told['verdict']} {told['codes'] or ''}", flush=True)
            for each in of:
                if each.outcome != "named" or each.passed:
                    codes = ", ".join(sorted(set(each.codes)))
                    print(
                        f"  {each.outcome}: {each.mutation}: {each.verdict} ({codes}) {each.seconds:.1f} s", flush=True
                    )
    return clean, trials


def summary(trials: list[Trial]) -> list[dict[str, Any]]:
    """By line of the table of mutations, and over all."""
    out = []
    for row in [*dict.fromkeys(t.row for t in trials), "all"]:
        of = [t for t in trials if row in (t.row, "all")]
        count = {outcome: sum(t.outcome == outcome for t in of) for outcome in ("named", "missed", "harmless")}
        judged = count["named"] + count["missed"]
        rate = count["named"] / judged if judged else None
        seconds = float(np.median([t.seconds for t in of]))
        out.append({"row": row, **count, "rate": rate, "passed": sum(t.passed for t in of), "median_s": seconds})
    return out


HEAD = ("mix-up", "named", "missed", "harmless", "rate", "good though moved", "CPU time, median [s]")


def told(of: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    rate = "" if of["rate"] is None else f"{100 * of['rate']:.1f} %"
    counts = (str(of[key]) for key in ("named", "missed", "harmless"))
    return of["row"], *counts, rate, str(of["passed"]), f"{of['median_s']:.2f}"


def main(arguments: list[str]) -> None:
    """Run, print; the whole run also writes results/mutations.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutations", description=__doc__)
    parser.add_argument("--only", nargs="*", default=["real", "simulated"], choices=["real", "simulated"])
    parser.add_argument("--kinds", nargs="*", default=[], metavar="KIND", help="kinds of cells")
    parser.add_argument("--cells", type=int, default=None, help="at most so many of each kind")
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args(arguments)
    began = time.perf_counter()
    cases = [case for name in asked.only for case in {"real": real, "simulated": simulated}[name]()]
    cases = [c for c in cases if not asked.kinds or c.kind in asked.kinds]
    clean, trials = run([c for c in cases if asked.cells is None or c.seed % 100 < asked.cells], asked.workers)
    found = summary(trials)
    print("\n" + table(HEAD, map(told, found)))
    of_cells = [c for c in clean if c["simulated"]]
    bad = [c for c in of_cells if c["verdict"] != "good"]
    print(f"\nclean simulated cells not good: {len(bad)} of {len(of_cells)}; {time.perf_counter() - began:.0f} s")
    if not asked.kinds and asked.cells is None and len(asked.only) == 2:
        told_trials = [t._asdict() for t in trials]
        write("mutations", {"clean": clean, "asked": NAMED, "summary": found, "trials": told_trials})


if __name__ == "__main__":
    main(sys.argv[1:])
