"""Two arms that touch: is the covariance true, is the missing direction named, are faults found, does a plan help.

    python -m benchmarks.touch [--seeds 200] [--faults 40] [--cells 30]

Two exact arms, tips of unknown length and three marks of unknown place; 12 to 60 touches with an error of 0.05 to 0.5
mm per axis that is stated or not. NEES/6 of the base is 1 if the covariance is true. Likewise a part that both hold,
rigid or a hinge, tips that meet (a ball joint), planes, and edges with two marks, by `solve`. Without the third mark
the rotation about the line through the others is open: the axis that is named has to be it, to two decimals. A mark
that moved by 5 mm, a touch of the wrong mark and a tip bent by 5 mm at half time each count as found if the verdict is
not good or a touch is left out, and as named if a finding names the mark, the tip or the sample. Plans: after twelve
touches of two marks of random places, a third mark and twelve touches as planned, or feasible ones at random.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable
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
from basecal.planning.touches import NEXT_MARK, plan_touches
from benchmarks.common import on_one_core, table, write

SIZES = ((12, 5e-5), (24, 2e-4), (60, 5e-4))
SIGMA_M, MOVED_M = 2e-4, 5e-3
PLANES = {"floor": "plane", "wall": "plane", "side": "plane"}
EDGE = {"wall": "edge", "mark_a": "point", "mark_b": "point"}
FAULTS = ("moved mark", "wrong mark", "bent tip")
TASK = np.array([0.6, 0.1, 0.3])
Lines = list[dict[str, Any]]

CONTACTS: dict[str, tuple[Callable[[], Cell], Callable[[np.random.Generator], Lines]]] = {
    "rigid part": (lambda: clamp_cell("fixed"), lambda rng: clamp_lines(held_poses(rng, 20))),
    "hinge": (lambda: clamp_cell("free"), lambda rng: clamp_lines(held_poses(rng, 20, is_hinge=True))),
    "tips that meet": (lambda: touch_cell(()), lambda rng: touch_lines(rng, 24, SIGMA_M, {})),
    "three planes": (lambda: surface_cell(PLANES), lambda rng: surface_lines(rng, 60, SIGMA_M, PLANES)),
    "an edge and two marks": (lambda: surface_cell(EDGE), lambda rng: surface_lines(rng, 48, SIGMA_M, EDGE)),
}


def square(found: PoseEstimate) -> float:
    """NEES/6 of the base."""
    off = (found.mean.inverse() @ TRUTH).log()
    return float(off @ np.linalg.solve(found.covariance, off) / 6)


def consistency(seeds: int, is_stated: bool) -> dict[str, Any]:
    """NEES of the base over all sizes in turn, and verdicts."""
    cell, squares, verdicts = touch_cell(), [], Counter[str]()
    for seed in range(seeds):
        count, sigma_m = SIZES[seed % len(SIZES)]
        lines = touch_lines(np.random.default_rng(seed), count, sigma_m, MARKS, is_stated)
        found = calibrate(cell, recorded(cell, lines))
        verdicts[found.verdict] += 1
        if BASE in found.transforms:
            squares.append(square(found[BASE]))
    return {**_of_squares(squares), "verdicts": dict(verdicts)}


def contact(seeds: int, kind: str) -> dict[str, Any]:
    """NEES of the base by contacts of a kind, noise unstated."""
    make, lines_of = CONTACTS[kind]
    cell = make()
    lines = (lines_of(np.random.default_rng(seed)) for seed in range(seeds))
    return _of_squares([square(solve(cell, recorded(cell, each)).transforms[BASE]) for each in lines])


def _of_squares(squares: list[float]) -> dict[str, Any]:
    error = float(np.std(squares) / np.sqrt(len(squares)))
    return {"nees": float(np.mean(squares)), "error": error, "trials": len(squares)}


def missing_mark(seeds: int) -> dict[str, int]:
    """How often it is refused with the line through both marks as the axis."""
    marks = {name: MARKS[name] for name in ("mark_a", "mark_b")}
    line = marks["mark_b"] - marks["mark_a"]
    words = "({:.2f}, {:.2f}, {:.2f})".format(*(line / np.linalg.norm(line)))
    cell, right = touch_cell(list(marks)), 0
    for seed in range(seeds):
        found = calibrate(cell, recorded(cell, touch_lines(np.random.default_rng(seed), 24, SIGMA_M, marks)))
        named = any(f.code == "unobservable-direction" and words in f.what for f in found.findings)
        right += found.verdict == "refused" and named
    return {"right": right, "trials": seeds}


def faults(seeds: int, fault: str) -> dict[str, Any]:
    """How often a fault is found, and named."""
    cell, found_count, named_count, codes = touch_cell(), 0, 0, Counter[str]()
    for seed in range(seeds):
        lines, about = faulty_lines(np.random.default_rng(seed), fault)
        found = calibrate(cell, recorded(cell, lines))
        found_count += found.verdict != "good" or bool(found.outliers)
        named_count += is_named(found, about)
        codes.update({f.code for f in found.findings})
    return {"found": found_count, "named": named_count, "trials": seeds, "codes": dict(codes)}


def faulty_lines(rng: np.random.Generator, fault: str) -> tuple[Lines, set[str]]:
    """Lines of 36 touches with a fault, and what a finding has to name."""
    lines = touch_lines(rng, 36, SIGMA_M)
    if fault == "wrong mark":
        wrong = int(rng.integers(len(lines)))
        seen = lines[wrong]["observations"][0]
        seen["touch"] = next(name for name in MARKS if name != seen["touch"])
        return lines, {str(wrong)}
    off = rng.normal(size=3)
    off *= MOVED_M / np.linalg.norm(off)
    for line in lines[len(lines) // 2 :]:
        (robot,), (seen,) = line["robots"], line["observations"]
        place = MARKS[seen["touch"]] + SIGMA_M * rng.standard_normal(3)
        if fault == "moved mark" and seen["touch"] == "mark_b":
            line["robots"] = {robot: state(flange_pose(rng, robot, place + off))}
        elif fault == "bent tip" and robot == "hand":
            straight = TIPS["hand"].copy()
            TIPS["hand"] = straight + off
            line["robots"] = {robot: state(flange_pose(rng, robot, place))}
            TIPS["hand"] = straight
    return lines, {"mark_b"} if fault == "moved mark" else {"hand_tip"}


def is_named(found: Calibration, about: set[str]) -> bool:
    """Whether a finding or an outlier names it."""
    words = {word for f in found.findings for word in (*f.about, *f.message.replace(".", " ").split())}
    words |= {word.rpartition("_from_")[2] for word in words}
    outliers = {name for o in found.outliers or () for name in (str(o.sample), o.target, o.camera)}
    return bool(about & (words | outliers))


def plans(cells: int) -> dict[str, Any]:
    """Errors at the task [m] after planned and after random touches, by cell."""
    both = [planned_and_random(np.random.default_rng([seed, 5])) for seed in range(cells)]
    medians = np.median(both, axis=0)
    return {"planned_m": medians[0], "random_m": medians[1], "ratio": medians[0] / medians[1], "trials": cells}


def planned_and_random(rng: np.random.Generator) -> tuple[float, float]:
    """Of one cell: two marks at random places, a base that is known to some centimetres and degrees."""
    two = {name: np.array([0.5, 0.0, 0.2]) + rng.uniform(-0.25, 0.25, 3) for name in ("mark_a", "mark_b")}
    lines = touch_lines(rng, 12, SIGMA_M, two)
    cell = _guessed_cell(list(two), rng)
    known = recorded(cell, lines)
    plan = plan_touches(cell, known, calibrate(cell, known), TASK[None], count=12)
    marks = {**two, **plan.marks}
    chosen = [(seen.tip, seen.mark, s.robots) for s in plan.samples for seen in s.observations]
    more = []
    for tip, mark, robots in chosen:
        ((robot, planned),) = robots.items()
        place = marks[mark] + SIGMA_M * rng.standard_normal(3)
        rotation = planned.base_from_flange.rotation  # a person leads the tip there, turned as planned
        base = SE3.identity() if robot == "eye" else TRUTH
        flange = SE3(rotation, base.inverse() @ place - rotation @ TIPS[robot])
        more.append({"robots": {robot: state(flange)}, "observations": [{"touch": mark, "tip": tip}]})
    third = {**two, NEXT_MARK: _random_place(rng, two)}
    drawn = touch_lines(rng, 12, SIGMA_M, {name: third[name] for name in rng.permutation(list(third))})
    return _task_error(cell, lines, more, rng), _task_error(cell, lines, drawn, rng)


def _random_place(rng: np.random.Generator, two: dict[str, Array]) -> Array:
    """A place that both arms reach as far as they did for the marks."""
    middle = np.mean(list(two.values()), axis=0)
    far = [max(np.linalg.norm(at - base) for at in two.values()) for base in (np.zeros(3), TRUTH.translation)]
    while True:
        place = middle + rng.uniform(-0.6, 0.6, 3)
        near = [np.linalg.norm(place - base) for base in (np.zeros(3), TRUTH.translation)]
        if np.linalg.norm(place - middle) < 0.6 and all(a < 1.05 * b for a, b in zip(near, far, strict=True)):
            return place


def _guessed_cell(names: list[str], rng: np.random.Generator) -> Cell:
    guess = TRUTH @ SE3.exp(rng.normal(0, 0.03, 6))
    pose = {"t_m": guess.translation.tolist(), "q_xyzw": guess.quaternion.tolist()}
    return touch_cell(names, bases={"hand": {"status": "prior", **pose, "sigma_t_m": 0.05, "sigma_r_rad": 0.1}})


def _task_error(cell: Cell, lines: Lines, more: Lines, rng: np.random.Generator) -> float:
    """How far a point of the other arm is off at the task [m], by the recording with these lines more."""
    wider = _guessed_cell([*(t for t, of in cell.targets.items() if of.on == "world"), NEXT_MARK], rng)
    numbered = [{**line, "sample": k} for k, line in enumerate([*lines, *more])]
    found = solve(wider, recorded(wider, numbered)).transforms[BASE].mean
    return float(np.linalg.norm(found @ (TRUTH.inverse() @ TASK) - TASK))


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows = [
        (name, f"{of['nees']:.2f} ± {of['error']:.2f}", of["trials"], of.get("verdicts", {}).get("good", ""))
        for name, of in result["consistency"].items()
    ]
    named = [(name, of["found"], of["named"], of["trials"]) for name, of in result["faults"].items()]
    two, plan = result["two_marks"], result["plan"]
    about = f"""\
Two exact arms whose tips touch marks, planes and edges, meet, or hold one part. Nothing is known of tips, marks and
grips. NEES/6 of the base is 1 if the covariance is true.

{table(("contact", "NEES/6", "trials", "good"), rows)}

With two marks the answer was refused with the right axis in {two["right"]} of {two["trials"]}. Faults of 5 mm at half
time:

{table(("fault", "found", "named", "trials"), named)}

A third mark and twelve touches as `plan --touches` has them leave {1e3 * plan["planned_m"]:.2f} mm at the task, random
ones {1e3 * plan["random_m"]:.2f} mm (medians of {plan["trials"]} cells): {plan["ratio"]:.2f} times as much."""
    return about


def main(arguments: list[str]) -> None:
    """Run, print and write results/touch.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.touch", description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--faults", type=int, default=40)
    parser.add_argument("--cells", type=int, default=30)
    given = parser.parse_args(arguments)
    on_one_core()
    found = {
        "plan": plans(given.cells),
        "consistency": {kind: contact(given.seeds, kind) for kind in CONTACTS}
        | {f"marks, noise {name}": consistency(given.seeds, name == "stated") for name in ("stated", "unstated")},
        "two_marks": missing_mark(given.seeds // 2),
        "faults": {fault: faults(given.faults, fault) for fault in FAULTS},
    }
    print(section(found))
    write("touch", found)


if __name__ == "__main__":
    main(sys.argv[1:])
