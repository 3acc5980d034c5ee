"""Benefit of each rescue: the cells with a worse answer while it is switched off.

A rescue is a part that only problematic data reach: another start, a search among subsets, points judged by their view.
Each is replaced by a function that does nothing. Cells of `benchmarks.starts` and `benchmarks.outliers`, a long ring of
robots, cells and real recordings of `benchmarks.reference` and mix-ups of `benchmarks.mutations` are first solved with
all rescues, and it is noted which of them act. Only cells in which a rescue acted are solved again without it, since
all others are equal.

A start is worse if it ends in another optimum than from the truth. Outliers are worse if the error of the base is twice
that of the oracle, or fewer are found. An answer differs if a verdict, a finding, a transform or a sigma differs. A
mix-up is worse if it is no longer named, or if the answer is called good. A rescue without benefit is to be removed.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tests.shared.kinds import KINDS
from tests.shared.mutate import Mutation, lines_of, mutations, recording_of
from tests.shared.start_trial import trial as start_trial

from basecal.accuracy.calibrate import calibrate
from basecal.cell.targets.chessboard import chessboard_target
from basecal.estimation.outliers.inlier_mask import all_inliers
from basecal.simulation import Scenario
from benchmarks import mutations as mix_ups
from benchmarks import outliers
from benchmarks.common import on_one_core, table, write
from benchmarks.reference.answers import answer, differences
from benchmarks.reference.cases import cases

RING, FAR_BOARD = "ring of ten robots", "a small board far away"
OVER_ORACLE = 2.0  # times the oracle's error: beyond, the answer is another one
FIRST_SEED = 30000  # of outliers; no setting was tuned on these
_START, _OUTLIERS = "basecal.estimation.start.", "basecal.estimation.outliers."
_CHECKS, _STAGES = "basecal.accuracy.input_check.", "basecal.accuracy.stages."
KINDS.setdefault(RING, replace(Scenario(layout="chain"), robots=10))
KINDS.setdefault(FAR_BOARD, Scenario(target="chessboard", board=chessboard_target((4, 4), 0.03), distance_m=(1.5, 2.5),
                               pixel_px=1.5, spread_rad=0.4, robot_noise=(1e-4, 2e-4)))  # fmt: skip

Answer = Any
Baseline = tuple[Answer, list[str]]
"""An answer with every rescue in place, and those that acted."""


class Rescue(NamedTuple):
    """A function that can be switched off.

    Attributes:
        module: Module in which the name is looked up.
        name: Name of a function, or of a class and its method.
        replacement: The function that replaces it.
        has_acted: Whether a result is that of a rescue that acted.
    """

    module: str
    name: str
    replacement: Callable[..., Any]
    has_acted: Callable[[Any], bool] = lambda _: True


def _no_flips(group: Any, *_: Any) -> Any:
    return np.zeros(len(group), dtype=bool)


def _repeat_start(_measurement: Any, subsets: Any, _camera: Any, start: Any) -> Any:
    return start[np.tile(np.arange(len(start)), len(subsets) // len(start))]


RESCUES: dict[str, Rescue] = {
    "all pairs of a long ring at once": Rescue(_START + "first_state", "place_by_pairs", lambda *_: {}, bool),
    "pairs of a ring restarted alone": Rescue(_START + "all_pairs", "_restart_pairs", lambda wishes: wishes),
    "another start where the first is implausible": Rescue(
        "basecal.estimation.solve", "_is_plausible", lambda *_: True, lambda found: not found
    ),
    "grids read from their other end": Rescue(_START + "pair_views", "half_turn_mask", _no_flips, np.any),
    "both poses of ambiguous views": Rescue(
        _START + "pair_views", "PairViews.ambiguous_loop", lambda *_: None, lambda found: found is not None
    ),
    "rotations settled by the better poses": Rescue(_START + "refinement", "refine_rotations", lambda *_: [], bool),
    "bases turned about their contacts": Rescue(_START + "first_state", "rotated_base_states", lambda *_: ()),
    "points judged by their view": Rescue(
        _OUTLIERS + "robust_solve",
        "agreeing_points",
        lambda problem, *_: all_inliers(problem).points,
        lambda found: not all(np.all(each) for each in found),
    ),
    "random points of a view": Rescue(
        _OUTLIERS + "view_ransac",
        "_subsets",
        lambda seen: np.zeros((0, *seen.shape), dtype=bool),
        lambda of: len(of) > 2,
    ),
    "poses of random points in closed form": Rescue(_OUTLIERS + "view_ransac", "_closed_form", _repeat_start),
    "points taken back": Rescue(_OUTLIERS + "robust_solve", "readmit_points", lambda _problem, _state, kept, _: kept),
    "views that stand out": Rescue(
        _OUTLIERS + "noise_and_outliers", "leave_out_suspects", lambda *_: None, lambda found: found is not None
    ),
    "views taken back": Rescue(_OUTLIERS + "classify", "_readmit", lambda _model, _problem, inliers, *_: inliers),
    "subsets of samples": Rescue(_OUTLIERS + "robust_solve", "subset_states", lambda *_: ()),
    "random subsets of samples": Rescue(_OUTLIERS + "subset_starts", "_subsets", lambda *_: iter(())),
    "subsets drawn on": Rescue(_OUTLIERS + "subset_starts", "_concentrate", lambda _, states: states),
    "all starts of a light": Rescue(_OUTLIERS + "subset_starts", "led_states", lambda *_: ()),
    "samples that alone agree": Rescue(_OUTLIERS + "robust_solve", "agreeing_samples", lambda *_: (), bool),
    "judged again by other sigmas": Rescue(_OUTLIERS + "noise_and_outliers", "judge_again", lambda *_: None),
    "stated lenses widened": Rescue(_STAGES + "solving", "with_likely_lenses", lambda robust, *_: robust),
    "fits of most views": Rescue(_CHECKS + "hypothesis_fit", "_concentrate", lambda solution, _: solution),
    "rare mix-ups of the input": Rescue(_CHECKS + "conventions", "rare_hypotheses", lambda *_: []),
    "half turns of flanges": Rescue(_CHECKS + "conventions", "half_turn_hypotheses", lambda *_: [], bool),
    "pairing that slips": Rescue(_CHECKS + "conventions", "slip_hypotheses", lambda *_: [], bool),
    "sizes of targets": Rescue(_CHECKS + "conventions", "size_hypotheses", lambda *_: [], bool),
    "lenses freed": Rescue(_CHECKS + "hypotheses", "_lens_hypotheses", lambda *_: ()),
    "transforms freed": Rescue(_CHECKS + "hypotheses", "_fixed_transform_hypotheses", lambda *_: ()),
    "offsets that explain": Rescue(_STAGES + "solving", "joint_offset_findings", lambda *_: []),
}


def locate(rescue: Rescue) -> tuple[Any, str]:
    """The module or class that holds the function of a rescue, and its name there."""
    *owners, name = rescue.name.split(".")
    place: Any = importlib.import_module(rescue.module)
    for each in owners:
        place = getattr(place, each)
    return place, name


@contextmanager
def replace_function(rescue: Rescue, function: Callable[..., Any]) -> Iterator[None]:
    """Replace the function of a rescue within the context."""
    place, name = locate(rescue)
    original = getattr(place, name)
    setattr(place, name, function)
    try:
        yield
    finally:
        setattr(place, name, original)


def with_record(name: str, rescue: Rescue, acting: set[str]) -> Callable[..., Any]:
    """The function of the rescue, which adds its name to a set if it acts."""
    place, attribute = locate(rescue)
    original = getattr(place, attribute)

    def call(*arguments: Any, **options: Any) -> Any:
        result = original(*arguments, **options)
        if rescue.has_acted(result):
            acting.add(name)
        return result

    return call


def _try_start(kind: str, seed: int) -> bool:
    """Whether a start ends in the best optimum, or the best optimum is unknown."""
    return start_trial(kind, seed).verdict != "other"


def _try_outliers(name: str, seed: int) -> list[int]:
    """Whether the error of the base is within the factor of the oracle's, and how many outliers are found."""
    trial = outliers.trial(name, FIRST_SEED + seed)
    is_near = all(ours <= OVER_ORACLE * best for ours, best in zip(trial.ours, trial.oracle, strict=True))
    return [int(is_near), trial.found]


@lru_cache(maxsize=1)
def _mix_ups() -> dict[str, tuple[mix_ups.Case, Mutation]]:
    every = [*mix_ups.real_cases(), *mix_ups.simulated_cases()]
    return {f"{c.name}: {m.name}": (c, m) for c in every for m in mutations(c.cell, lines_of(c.recording), c.seed)}


def _try_mix_up(name: str, _seed: int) -> list[int]:
    """Whether a mix-up is named, and whether the answer is not called good."""
    case, mutation = _mix_ups()[name]
    calibration = calibrate(mutation.cell, recording_of(mutation.lines(lines_of(case.recording)), mutation.cell))
    return [int(mix_ups.is_named(case, mutation, calibration)), int(calibration.verdict != "good")]


MEASURES: dict[str, Callable[[str, int], Answer]] = {
    "start": _try_start,
    "outliers": _try_outliers,
    "answer": lambda name, _: answer(name),
    "mix-up": _try_mix_up,
}
_FAILED: dict[str, Answer] = {
    "start": False,
    "outliers": [0, -1],
    "answer": {"verdict": "failed", "findings": [], "transforms": {}},
    "mix-up": [0, 1],
}

Job = tuple[str, str, int]


def make_jobs(seeds: int, every: int) -> list[Job]:
    """Measure, name and seed of all jobs."""
    starts = [("start", kind, seed) for seed in range(seeds) for kind in KINDS]
    outlier_jobs = [("outliers", name, seed) for seed in range(seeds) for name in outliers.CASES]
    names = list(cases())
    chosen = [name for name in names if not name.startswith("simulated")]
    chosen += [name for name in names if name.startswith("simulated")][::every]
    mix_up_names = list(_mix_ups())[::every]
    return [
        *starts,
        *outlier_jobs,
        *(("answer", name, 0) for name in chosen),
        *(("mix-up", name, 0) for name in mix_up_names),
    ]


def measure(job: Job) -> Answer:
    """Run one job."""
    kind, name, seed = job
    try:
        return MEASURES[kind](name, seed)
    except (np.linalg.LinAlgError, ArithmeticError, AssertionError, ValueError, IndexError):
        return _FAILED[kind]


def is_worse(kind: str, before: Answer, after: Answer) -> bool:
    """Whether an answer is worse without a rescue; for whole answers, whether it differs."""
    if kind == "answer":
        return any(differences(before, after))
    return any(b > a for b, a in zip(np.atleast_1d(before), np.atleast_1d(after), strict=True))


def measure_with_rescues(job: Job) -> Baseline:
    """One cell with all rescues in place, and the names of those that acted."""
    acting: set[str] = set()
    with ExitStack() as stack:
        for name, rescue in RESCUES.items():
            stack.enter_context(replace_function(rescue, with_record(name, rescue, acting)))
        result = measure(job)
    return result, sorted(acting)


class KeptAnswers:
    """Answers that are kept in a file, so that a run can continue an earlier one."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        lines = path.read_text(encoding="utf-8").splitlines() if path is not None and path.exists() else []
        self.found: dict[tuple[Any, ...], Any] = {tuple(key): value for key, value in map(json.loads, lines)}

    def get(self, key: tuple[Any, ...], work: Callable[[], Any]) -> Any:
        """The kept answer of a key, computed and kept if there is none yet."""
        if key not in self.found:
            self.found[key] = json.loads(json.dumps(work()))
            if self.path is not None:
                with self.path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps([key, self.found[key]]) + "\n")
        return self.found[key]


def measure_without(
    kept: KeptAnswers, name: str, jobs: Sequence[Job], before: Mapping[Job, Baseline]
) -> dict[str, Any]:
    """Number of cells by measure in which a rescue acted, and those that are worse without it."""
    rescue, acted = RESCUES[name], [job for job in jobs if name in before[job][1]]
    worse: dict[str, list[str]] = {kind: [] for kind in MEASURES}
    with replace_function(rescue, rescue.replacement):
        for job in acted:
            after = kept.get((name, *job), lambda job=job: measure(job))
            if is_worse(job[0], before[job][0], after):
                worse[job[0]].append(f"{job[1]} {job[2]}" if job[0] in ("start", "outliers") else job[1])
    return {"acted": {kind: sum(job[0] == kind for job in acted) for kind in MEASURES}, "worse": worse}


def main(arguments: list[str]) -> None:
    """Run, print; the whole run also writes results/rescues.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rescues", description=__doc__)
    parser.add_argument("--seeds", type=int, default=8, help="of each kind of start and outlier")
    parser.add_argument("--every", type=int, default=6, help="each so many of the simulated cells and the mix-ups")
    parser.add_argument("--only", default="", help="rescues whose name has this")
    parser.add_argument("--keep", type=Path, default=None, metavar="FILE", help="go on with a run")
    parser.add_argument("--part", type=int, nargs=2, default=(0, 1), metavar=("K", "N"), help="the K-th of N parts")
    asked = parser.parse_args(arguments)
    on_one_core()
    part, parts = asked.part
    jobs, kept = make_jobs(asked.seeds, asked.every)[part::parts], KeptAnswers(asked.keep)
    before = {job: kept.get(("", *job), lambda job=job: measure_with_rescues(job)) for job in jobs}
    counts = {kind: sum(job[0] == kind for job in jobs) for kind in MEASURES}
    rows, effects = [], {}
    for name in (each for each in RESCUES if asked.only in each):
        effects[name] = measure_without(kept, name, jobs, before)
        effect = effects[name]
        rows.append(
            (
                name,
                *(f"{len(effect['worse'][k])} of {effect['acted'][k]}" if effect["acted"][k] else "" for k in MEASURES),
            )
        )
        print(*rows[-1], sep="  ", flush=True)
    head = ("without", *(f"{kind}: worse of those where it acted, of {counts[kind]}" for kind in MEASURES))
    print("\n" + table(head, rows))
    if not asked.only and parts == 1:
        write("rescues", {"counts": counts, "rescues": effects})


if __name__ == "__main__":
    main(sys.argv[1:])
