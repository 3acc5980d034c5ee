"""Two real arms: held-out error of the loop, compared with two of OpenCV's calibrations, concatenated.

Two NAO humanoids were recorded three times with one of them still, and 298 times with both in motion. All three
unknowns are estimated from a run with the hand still and a run with the eye still, with no noise stated. `calibrate`
uses the two runs together. Users of OpenCV calibrate each alone by one of seven methods, and concatenate at the camera
or at the target. The 298 triples are held out: the error is the rms of their open loops,
`(A X B).inverse() @ Y C Z`. Of OpenCV's fourteen answers the best in hindsight counts, separately in mm and degrees.

Other recordings of two arms have no part with one arm still, so that OpenCV has nothing to concatenate.
"""

from __future__ import annotations

import argparse
import sys
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.io import loadmat
from tests.shared.real_recordings import data_folder, nao_cell

from basecal.accuracy.calibrate import calibrate
from basecal.cell import PoseObservation, Recording, RobotState, Sample
from basecal.errors import DatasetError
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import nearest_rotation
from benchmarks.common import on_one_core, table, write
from benchmarks.peers.by_opencv import CHAINS, METHODS, TwoArms, concatenate

FOLDER, FILE = "nao_dual_axbycz", "transform_ABC_unified"
STREAMS = ("headTf", "tagTf", "handTf")
RUNS = 3
HEAD = ("hand still", "eye still", "verdict", "ours [mm]", "[deg]", "OpenCV's best", "[mm]", "its best", "[deg]",
        "ratio mm", "ratio deg")  # fmt: skip


class Run(NamedTuple):
    """Poses of the eye's flange, of the tag and of the hand's flange, (n,) each."""

    eye: SE3
    views: SE3
    hand: SE3


def _poses(matrices: Array) -> SE3:
    stacked = np.stack([np.asarray(each, dtype=np.float64) for each in np.ravel(matrices)])
    return SE3(nearest_rotation(stacked[:, :3, :3]), stacked[:, :3, 3])


def runs() -> tuple[list[Run], list[Run], Run]:
    """Runs with the hand still, runs with the eye still, and the run with both in motion."""
    folder = data_folder() / FOLDER
    if not folder.exists():
        raise DatasetError(str(folder), "does not exist: set BASECAL_DATA to the folder of the published recordings")
    eye_still, hand_still = (loadmat(folder / f"{FILE}_fix{letter}.mat") for letter in "AC")
    both = loadmat(folder / f"{FILE}.mat")
    return (
        [Run(*(_poses(hand_still[f"{name}2"][0, k]) for name in STREAMS)) for k in range(RUNS)],
        [Run(*(_poses(eye_still[f"{name}1"][0, k]) for name in STREAMS)) for k in range(RUNS)],
        Run(*(_poses(both[name]) for name in STREAMS)),
    )


def _recording(runs: list[Run]) -> Recording:
    rows = [(run.eye[k], run.views[k], run.hand[k]) for run in runs for k in range(len(run.views))]
    return Recording(
        tuple(
            Sample(k, float(k), {"eye": RobotState(a), "hand": RobotState(c)}, (PoseObservation("camera", "tag", b),))
            for k, (a, b, c) in enumerate(rows)
        )
    )


def errors(estimates: TwoArms, held_out: Run) -> tuple[float, float]:
    """Rms of the open loops of three transforms [mm, deg]."""
    left = held_out.eye @ estimates.eye_flange_from_camera @ held_out.views
    off = left.inverse() @ estimates.eye_base_from_hand_base @ held_out.hand @ estimates.hand_flange_from_target
    squares = np.sum(off.translation**2, -1).mean(), np.sum(off.rotvec**2, -1).mean()
    return 1e3 * float(np.sqrt(squares[0])), float(np.degrees(np.sqrt(squares[1])))


def measure(hand_still: Run, eye_still: Run, held_out: Run) -> dict[str, Any]:
    """Errors of ours and of OpenCV's best from two runs."""
    cell, _ = nao_cell()
    calibration = calibrate(cell, _recording([hand_still, eye_still]))
    names = ("eye_base_from_hand_base", "eye_flange_from_camera", "hand_flange_from_tag")
    ours = errors(TwoArms(*(calibration[name].mean for name in names)), held_out)
    theirs = {
        method + chain: errors(each, held_out)
        for method in METHODS
        for chain, each in zip(CHAINS, concatenate(method, hand_still, eye_still), strict=False)
    }
    best = [min(theirs, key=lambda name: theirs[name][k]) for k in range(2)]
    smallest = [theirs[name][k] for k, name in enumerate(best)]
    ratios = [mine / each for mine, each in zip(ours, smallest, strict=True)]
    return {"verdict": calibration.verdict, "ours": ours, "best": best, "opencv": smallest, "ratios": ratios}


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    ours, theirs = ([f"{each:.3g}" for each in result[k]] for k in ("ours", "opencv"))
    peers = (result["best"][0], theirs[0], result["best"][1], theirs[1])
    numbers = (str(result["hand_still"]), str(result["eye_still"]), result["verdict"])
    return (*numbers, *ours, *peers, *(f"{each:.2f}" for each in result["ratios"]))


def main(arguments: list[str]) -> None:
    """Measure, print, and write results/two_arms.json."""
    argparse.ArgumentParser(prog="python -m benchmarks.two_arms", description=__doc__).parse_args(arguments)
    on_one_core()
    first, second, held_out = runs()
    rows = []
    for i, j in product(range(RUNS), range(RUNS)):
        rows.append({"hand_still": i + 1, "eye_still": j + 1, **measure(first[i], second[j], held_out)})
        print(", ".join(row(rows[-1])), flush=True)
    print(table(HEAD, map(row, rows)))
    write("two_arms", {"rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
