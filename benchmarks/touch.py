"""Two arms that touch marks: true covariances, open directions, detection of faults, and the benefit of plans.

    python -m benchmarks.touch [--seeds 200] [--faults 40] [--cells 30] [--keep FILE] [--only PART]

With `--keep FILE` each measured trial is a line of that file, and is not measured again. The results are written if all
parts are measured.

Two exact arms have tips of unknown length, and three marks have unknown places. There are 12 to 60 touches with an
error of 0.05 to 0.5 mm per axis, stated or not. NEES/6 of the base is 1 if the covariance is true. Other contacts are a
rigid part or a hinge that both arms hold, tips that meet (a ball joint), planes, and edges with two marks.

Without the third mark the rotation about the line through the others is open. The reported axis must be this line, to
two decimals. Faults are a mark that moves by 5 mm at half time, a touch of the wrong mark, and a tip that bends by 5 mm
at half time. A fault is found if the verdict is not good or a touch is left out. It is named if a finding names the
mark, the tip or the sample.

Plans: after twelve touches of two marks at random places, a third mark and twelve touches are added, planned or random
feasible ones. Recordings of real arms: see `touch_recordings`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tests.touch_cells import (
    BASE,
    MARKS,
    TIPS,
    TRUTH,
    clamp_cell,
    clamp_lines,
    flange_pose,
    held_poses,
    recorded,
    state,
    surface_cell,
    surface_lines,
    touch_cell,
    touch_lines,
)

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Cell
from basecal.estimation.solve import solve
from basecal.geometry import SE3, Array, PoseEstimate
from basecal.planning.plan import Plan
from basecal.planning.touches import NEXT_MARK, PLACES, ROTATIONS, plan_touches
from benchmarks import touch_recordings
from benchmarks.common import Kept, on_one_core, table, write

SIZES = ((12, 5e-5), (24, 2e-4), (60, 5e-4))
SIGMA_M, FAULT_M = 2e-4, 5e-3
PLANES = {"floor": "plane", "wall": "plane", "side": "plane"}
EDGE = {"wall": "edge", "mark_a": "point", "mark_b": "point"}
FAULTS = ("moved mark", "wrong mark", "bent tip")
TASK = np.array([0.6, 0.1, 0.3])
DRAWS = 25  # of the errors of touches in each cell of a plan
FEW_CANDIDATES = {"places": PLACES // 2, "rotations": ROTATIONS // 2}  # to choose from: what fewer candidates lose
Lines = list[dict[str, Any]]

CONTACTS: dict[str, tuple[Callable[[], Cell], Callable[[np.random.Generator], Lines]]] = {
    "rigid part": (
        lambda: clamp_cell("fixed"),
        lambda rng: clamp_lines(held_poses(rng, 20)),
    ),
    "hinge": (
        lambda: clamp_cell("free"),
        lambda rng: clamp_lines(held_poses(rng, 20, is_hinge=True)),
    ),
    "tips that meet": (
        lambda: touch_cell(()),
        lambda rng: touch_lines(rng, 24, SIGMA_M, {}),
    ),
    "three planes": (
        lambda: surface_cell(PLANES),
        lambda rng: surface_lines(rng, 60, SIGMA_M, PLANES),
    ),
    "an edge and two marks": (
        lambda: surface_cell(EDGE),
        lambda rng: surface_lines(rng, 48, SIGMA_M, EDGE),
    ),
}


def nees_over_6(estimate: PoseEstimate) -> float:
    """NEES/6 of the base."""
    error = (estimate.mean.inverse() @ TRUTH).log()
    return float(error @ np.linalg.solve(estimate.covariance, error) / 6)


def measure_marks(kept: Kept, seeds: int, noise: str) -> dict[str, Any]:
    """NEES of the base over all sizes in turn, with noise `stated` or `unstated`."""
    cell = touch_cell()

    def lines(seed: int) -> Lines:
        """Touches of the size whose turn it is."""
        count, sigma_m = SIZES[seed % len(SIZES)]
        return touch_lines(np.random.default_rng(seed), count, sigma_m, MARKS, noise == "stated")

    return _statistics([kept.of(f"{noise} {seed}", partial(_calibrate, cell, lines(seed))) for seed in range(seeds)])


def measure_contact(kept: Kept, seeds: int, kind: str) -> dict[str, Any]:
    """NEES of the base from contacts of a kind, with unstated noise."""
    make, lines = CONTACTS[kind]
    cell = make()
    draws = ((seed, lines(np.random.default_rng(seed))) for seed in range(seeds))
    return _statistics([kept.of(f"{kind} {seed}", partial(_calibrate, cell, each)) for seed, each in draws])


def _calibrate(cell: Cell, lines: Lines) -> tuple[str, float | None]:
    """The verdict, and NEES/6 of the base if it is estimated."""
    calibration = calibrate(cell, recorded(cell, lines))
    return calibration.verdict, nees_over_6(calibration[BASE]) if BASE in calibration.transforms else None


def _statistics(outcomes: list[tuple[str, float | None]]) -> dict[str, Any]:
    squares = [each for _, each in outcomes if each is not None]
    error = float(np.std(squares) / np.sqrt(len(squares)))
    verdicts = dict(Counter(verdict for verdict, _ in outcomes))
    return {
        "nees": float(np.mean(squares)),
        "error": error,
        "trials": len(outcomes),
        "verdicts": verdicts,
    }


def measure_missing_mark(kept: Kept, seeds: int) -> dict[str, int]:
    """Number of trials that are refused with the line through both marks as the axis."""
    two = {name: MARKS[name] for name in ("mark_a", "mark_b")}
    line = two["mark_b"] - two["mark_a"]
    words = "({:.2f}, {:.2f}, {:.2f})".format(*(line / np.linalg.norm(line)))
    cell = touch_cell(list(two))

    def is_right(seed: int) -> bool:
        """Whether the recording of a seed is refused with the right axis."""
        calibration = calibrate(
            cell,
            recorded(cell, touch_lines(np.random.default_rng(seed), 24, SIGMA_M, two)),
        )
        named = any(f.code == "unobservable-direction" and words in f.what for f in calibration.findings)
        return calibration.verdict == "refused" and named

    return {
        "right": sum(kept.of(f"two marks {k}", partial(is_right, k)) for k in range(seeds)),
        "trials": seeds,
    }


def measure_faults(kept: Kept, seeds: int, fault: str) -> dict[str, Any]:
    """Number of trials in which a fault is found, and in which it is named."""
    outcomes = [kept.of(f"{fault} {seed}", partial(_try_fault, fault, seed)) for seed in range(seeds)]
    found, named, codes = zip(*outcomes, strict=True)
    counts = dict(Counter(code for each in codes for code in each))
    return {"found": sum(found), "named": sum(named), "trials": seeds, "codes": counts}


def _try_fault(fault: str, seed: int) -> tuple[bool, bool, list[str]]:
    """Whether a fault is found, whether it is named, and the codes of findings."""
    lines, about = faulty_lines(np.random.default_rng(seed), fault)
    cell = touch_cell()
    calibration = calibrate(cell, recorded(cell, lines))
    is_found = calibration.verdict != "good" or bool(calibration.outliers)
    return is_found, is_named(calibration, about), sorted({f.code for f in calibration.findings})


def faulty_lines(rng: np.random.Generator, fault: str) -> tuple[Lines, set[str]]:
    """Lines of 36 touches with a fault, and the names that a finding must hold."""
    lines = touch_lines(rng, 36, SIGMA_M)
    if fault == "wrong mark":
        index = int(rng.integers(len(lines)))
        observation = lines[index]["observations"][0]
        observation["touch"] = next(name for name in MARKS if name != observation["touch"])
        return lines, {str(index)}
    shift = rng.normal(size=3)
    shift *= FAULT_M / np.linalg.norm(shift)
    for line in lines[len(lines) // 2 :]:
        (robot,), (observation,) = line["robots"], line["observations"]
        place = MARKS[observation["touch"]] + SIGMA_M * rng.standard_normal(3)
        if fault == "moved mark" and observation["touch"] == "mark_b":
            line["robots"] = {robot: state(flange_pose(rng, robot, place + shift))}
        elif fault == "bent tip" and robot == "hand":
            straight = TIPS["hand"].copy()
            TIPS["hand"] = straight + shift
            line["robots"] = {robot: state(flange_pose(rng, robot, place))}
            TIPS["hand"] = straight
    return lines, {"mark_b"} if fault == "moved mark" else {"hand_tip"}


def is_named(calibration: Calibration, about: set[str]) -> bool:
    """Whether a finding or an outlier holds one of the names."""
    words = {word for f in calibration.findings for word in (*f.about, *f.message.replace(".", " ").split())}
    words |= {word.rpartition("_from_")[2] for word in words}
    outliers = {name for o in calibration.outliers or () for name in (str(o.sample), o.target, o.camera)}
    return bool(about & (words | outliers))


def measure_plans(kept: Kept, cells: int) -> dict[str, Any]:
    """Median errors at the task [m] after planned, random, and planned touches from fewer candidates."""
    draws = ((seed, np.random.default_rng([seed, 5])) for seed in range(cells))
    errors = [kept.of(f"plan {seed}", partial(planned_errors, rng)) for seed, rng in draws]
    few, random, planned = np.median(np.concatenate(errors), axis=0).tolist()
    medians = {"planned_m": planned, "random_m": random, "few_m": few}
    return {**medians, "ratio": planned / random, "few_ratio": few / random, "trials": cells, "draws": DRAWS}


def planned_errors(rng: np.random.Generator) -> list[list[float]]:
    """Errors of one cell [m], by draws of the next touches: two marks at random places, a base roughly known."""
    two = {name: np.array([0.5, 0.0, 0.2]) + rng.uniform(-0.25, 0.25, 3) for name in ("mark_a", "mark_b")}
    lines = touch_lines(rng, 12, SIGMA_M, two)
    cell = _guessed_cell(list(two), rng)
    recording = recorded(cell, lines)
    plan = partial(plan_touches, cell, recording, calibrate(cell, recording), TASK[None], count=12)
    few, planned = plan(**FEW_CANDIDATES), plan()

    def next_touches() -> list[Lines]:
        """Touches from the small plan, at random, and from the plan."""
        return [_planned_lines(rng, few, two), _random_lines(rng, two), _planned_lines(rng, planned, two)]

    return [[_task_error(cell, lines, next_lines, rng) for next_lines in next_touches()] for _ in range(DRAWS)]


def _planned_lines(rng: np.random.Generator, plan: Plan, two: dict[str, Array]) -> Lines:
    """Touches as planned, with their errors."""
    lines, marks = [], {**two, **plan.marks}
    for sample in plan.samples:
        ((robot, planned),), (observation,) = sample.robots.items(), sample.observations
        place = marks[observation.target] + SIGMA_M * rng.standard_normal(3)
        rotation = planned.base_from_flange.rotation  # a person leads the tip there, turned as planned
        base = SE3.identity() if robot == "eye" else TRUTH
        flange = SE3(rotation, base.inverse() @ place - rotation @ TIPS[robot])
        lines.append(
            {
                "robots": {robot: state(flange)},
                "observations": [{"touch": observation.target, "tip": observation.camera}],
            }
        )
    return lines


def _random_lines(rng: np.random.Generator, two: dict[str, Array]) -> Lines:
    """Twelve touches of two marks and a third one anywhere."""
    third = {**two, NEXT_MARK: _random_place(rng, two)}
    return touch_lines(rng, 12, SIGMA_M, {name: third[name] for name in rng.permutation(list(third))})


def _random_place(rng: np.random.Generator, two: dict[str, Array]) -> Array:
    """A place within the reach of both arms, by their distances from the marks."""
    middle = np.mean(list(two.values()), axis=0)
    distances = [max(np.linalg.norm(mark - base) for mark in two.values()) for base in (np.zeros(3), TRUTH.translation)]
    while True:
        place = middle + rng.uniform(-0.6, 0.6, 3)
        reach = [np.linalg.norm(place - base) for base in (np.zeros(3), TRUTH.translation)]
        if np.linalg.norm(place - middle) < 0.6 and all(a < 1.05 * b for a, b in zip(reach, distances, strict=True)):
            return place


def _guessed_cell(names: list[str], rng: np.random.Generator) -> Cell:
    guess = TRUTH @ SE3.exp(rng.normal(0, 0.03, 6))
    pose = {"t_m": guess.translation.tolist(), "q_xyzw": guess.quaternion.tolist()}
    return touch_cell(
        names,
        bases={"hand": {"status": "prior", **pose, "sigma_t_m": 0.05, "sigma_r_rad": 0.1}},
    )


def _task_error(cell: Cell, lines: Lines, next_lines: Lines, rng: np.random.Generator) -> float:
    """Error of a point of the other arm at the task [m], after the next touches."""
    wider = _guessed_cell([*(t for t, entry in cell.targets.items() if entry.on == "world"), NEXT_MARK], rng)
    numbered = [{**line, "sample": k} for k, line in enumerate([*lines, *next_lines])]
    base = solve(wider, recorded(wider, numbered)).transforms[BASE].mean
    return float(np.linalg.norm(base @ (TRUTH.inverse() @ TASK) - TASK))


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows = [
        (
            name,
            f"{counts['nees']:.2f} ± {counts['error']:.2f}",
            counts["trials"],
            counts.get("verdicts", {}).get("good", ""),
        )
        for name, counts in result["consistency"].items()
    ]
    named = [(name, counts["found"], counts["named"], counts["trials"]) for name, counts in result["faults"].items()]
    two, plan = result["two_marks"], result["plan"]
    about = f"""\
The tips of two exact arms touch marks, planes and edges, or meet, or the arms hold one part. Tips, marks and grips are
unknown. NEES/6 of the base is 1 if the covariance is true.

{table(("contact", "NEES/6", "trials", "good"), rows)}

With two marks the answer was refused with the right axis in {two["right"]} of {two["trials"]} trials. Of the faults
below, a mark or a tip moves by 5 mm at half time, or one touch is of the wrong mark.

{table(("fault", "found", "named", "trials"), named)}

A third mark and twelve touches are added, planned by `plan --touches` or random. The median error at the task, of
{plan["trials"]} cells with {plan["draws"]} draws, is {1e3 * plan["planned_m"]:.2f} mm as planned. It is
{1e3 * plan["random_m"]:.2f} mm at random, a ratio of {plan["ratio"]:.2f}. The plan chooses among {PLACES} places and
{ROTATIONS} rotations. With half as many of both the ratio is {plan["few_ratio"]:.2f}."""
    return "\n\n".join([about, *touch_recordings.section(result.get("recordings", {}))])


def main(arguments: list[str]) -> None:
    """Run, print and write results/touch.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.touch", description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--faults", type=int, default=40)
    parser.add_argument("--cells", type=int, default=30)
    parser.add_argument("--keep", type=Path, help="file of what was measured")
    parser.add_argument("--only", nargs="+", help="parts whose names begin so")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept, seeds, result = Kept(asked.keep), asked.seeds, dict[str, dict[str, Any]]()
    parts: dict[tuple[str, ...], Callable[[], dict[str, Any]]] = {
        ("plan",): partial(measure_plans, kept, asked.cells),
        **{("consistency", kind): partial(measure_contact, kept, seeds, kind) for kind in CONTACTS},
        **{
            ("consistency", f"marks, noise {noise}"): partial(measure_marks, kept, seeds, noise)
            for noise in ("stated", "unstated")
        },
        ("two_marks",): partial(measure_missing_mark, kept, seeds // 2),
        **{("faults", fault): partial(measure_faults, kept, asked.faults, fault) for fault in FAULTS},
        ("recordings",): _recordings,
    }
    for (part, *kind), measure in parts.items():
        if asked.only is None or any(" ".join([part, *kind]).startswith(each) for each in asked.only):
            part_result = measure()
            print(part, *kind, part_result, flush=True)
            result.setdefault(part, {}).update({kind[0]: part_result} if kind else part_result)
    if asked.only is None:
        print(section(result))
        write("touch", result)


def _recordings() -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        return touch_recordings.recordings(Path(folder))


if __name__ == "__main__":
    main(sys.argv[1:])
