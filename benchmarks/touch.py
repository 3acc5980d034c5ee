"""Two arms that touch three marks: is the covariance true, is the missing direction named, are faults found.

    python -m benchmarks.touch [--seeds 200] [--faults 40]

Two exact arms, tips of unknown length and three marks of unknown place; 12 to 60 touches with an error of 0.05 to 0.5
mm per axis that is stated or not. NEES/6 of the base is 1 if the covariance is true. Without the third mark the
rotation about the line through the others is open: the axis that is named has to be it, to two decimals. A mark that
moved by 5 mm, a touch of the wrong mark and a tip bent by 5 mm at half time each count as found if the verdict is not
good or a touch is left out, and as named if a finding names the mark, the tip or the sample.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np
from tests.touch_cells import BASE, MARKS, TIPS, TRUTH, flange_pose, recorded, state, touch_cell, touch_lines

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration

SIZES = ((12, 5e-5), (24, 2e-4), (60, 5e-4))
SIGMA_M, MOVED_M = 2e-4, 5e-3


def main() -> None:
    """Print a row for each table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--faults", type=int, default=40)
    given = parser.parse_args()
    for is_stated in (True, False):
        consistency(given.seeds, is_stated)
    missing_mark(given.seeds // 2)
    for fault in ("moved mark", "wrong mark", "bent tip"):
        faults(given.faults, fault)


def consistency(seeds: int, is_stated: bool) -> None:
    """NEES of the base over all sizes in turn, and verdicts."""
    cell, squares, verdicts = touch_cell(), [], Counter[str]()
    for seed in range(seeds):
        count, sigma_m = SIZES[seed % len(SIZES)]
        found = calibrate(
            cell, recorded(cell, touch_lines(np.random.default_rng(seed), count, sigma_m, MARKS, is_stated))
        )
        verdicts[found.verdict] += 1
        if BASE in found.transforms:
            off = (found[BASE].mean.inverse() @ TRUTH).log()
            squares.append(off @ np.linalg.solve(found[BASE].covariance, off) / 6)
    noise = "stated" if is_stated else "unstated"
    error = np.std(squares) / np.sqrt(len(squares))
    print(
        f"noise {noise}: NEES/6 {np.mean(squares):.3f} +- {error:.3f} over {len(squares)}; {dict(verdicts)}", flush=True
    )


def missing_mark(seeds: int) -> None:
    """How often it is refused with the line through both marks as the axis."""
    marks = {name: MARKS[name] for name in ("mark_a", "mark_b")}
    line = marks["mark_b"] - marks["mark_a"]
    words = "({:.2f}, {:.2f}, {:.2f})".format(*(line / np.linalg.norm(line)))
    cell, right = touch_cell(list(marks)), 0
    for seed in range(seeds):
        found = calibrate(cell, recorded(cell, touch_lines(np.random.default_rng(seed), 24, SIGMA_M, marks)))
        named = any(f.code == "unobservable-direction" and words in f.what for f in found.findings)
        right += found.verdict == "refused" and named
    print(f"two marks: refused with the right axis in {right} of {seeds}", flush=True)


def faults(seeds: int, fault: str) -> None:
    """How often a fault is found, and named."""
    cell, found_count, named_count, codes = touch_cell(), 0, 0, Counter[str]()
    for seed in range(seeds):
        lines, about = faulty_lines(np.random.default_rng(seed), fault)
        found = calibrate(cell, recorded(cell, lines))
        found_count += found.verdict != "good" or bool(found.outliers)
        named_count += is_named(found, about)
        codes.update({f.code for f in found.findings})
    print(f"{fault}: found {found_count}, named {named_count} of {seeds}; {dict(codes)}", flush=True)


def faulty_lines(rng: np.random.Generator, fault: str) -> tuple[list[dict[str, object]], set[str]]:
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
    outliers = {name for o in found.outliers or () for name in (str(o.sample), o.target, o.camera)}
    return bool(about & (words | outliers))


if __name__ == "__main__":
    main()
