"""Whether the map of expected errors holds the true ones: both flanges sent to one point, on simulated cells.

Cells of two arms are solved from 25 samples. At the middle of the box of the map and at one of its corners both robots
are told to bring their flanges to the same point, turned as in the recorded pose nearest to it. How far the flanges
truly are from one another is to be within what the map expects of 95 in 100, and so is the angle between what is and
what was meant. `poses`: robots recorded by poses, off by 0.1 mm and 0.2 mrad per axis and stop. `joints`: arms of six
axes with offsets of 0.05 deg and links off by 0.1 mm and 0.2 mrad besides. `stated`: all sigmas are, and offsets and
links are estimated; `estimated`: nothing is stated, and arms are taken as their URDF has them, as `exact joints` are.
What an arm's errors shift its flange by everywhere alike is then in the mount of what hangs on it, and no recording
shows it: `but for mounts` is the same without that.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from basecal.accuracy.noise_summary import noise_summary
from basecal.accuracy.robot_parameters import calibrated_kinematics, robot_parameters
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.task_error import error_map
from basecal.cell import Calibration, ErrorMap
from basecal.errors import NotConverged
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve
from basecal.geometry import SE3, Array
from basecal.kinematics.inverse import inverse
from basecal.simulation import Scenario, SimulatedCell, simulate
from benchmarks.common import Kept, on_one_core, table, write

BASE = "eye_base_from_hand_base"
TRIALS = 500  # of each kind
NOISE = (1e-4, 2e-4)
_ROUNDS = 10
LOW, HIGH = 0.92, 0.98
PLACES = ("middle", "corner")
HEAD = ("cells", "trials", "mm, middle", "mm, corner", "deg, middle", "deg, corner", "expected, middle [mm]", "corner")

_POSES = Scenario(samples=25, robot_noise=NOISE)
_JOINTS = replace(_POSES, joints=True, joint_offset_rad=np.radians(0.05), link_error=NOISE)
_UNSTATED = {"state_robot_noise": False, "state_pixel_noise": False}
BUT_FOR_MOUNTS = ", but for mounts"
KINDS = {
    "poses, stated": _POSES,
    "poses, estimated": replace(_POSES, **_UNSTATED),
    "joints, stated": replace(_JOINTS, joint_offsets="prior", link_parameters="prior"),
    "joints, estimated": replace(_JOINTS, **_UNSTATED),
    "exact joints, estimated": replace(_POSES, joints=True, **_UNSTATED),
}


def calibrated(made: SimulatedCell, solution: Solution) -> Calibration:
    """The solution as a calibration, for what the map needs of it."""
    return Calibration(
        "good",
        dict(solution.transforms),
        noise=noise_summary(made.cell, made.recording, solution),
        robot_parameters=robot_parameters(solution),
    )


def trial(kind: str, seed: int) -> list[dict[str, Any]]:
    """One cell: at each place the true error and the one expected; none where an arm does not reach."""
    made = simulate(KINDS[kind], 40_000 + seed)
    solution = solve(made.cell, made.recording, Settings(robot_noise="estimated"))
    calibration = calibrated(made, solution)
    point = made.truth[BASE].translation / 2
    found = error_map(calibration, ArmErrors(made.cell, solution, solution), point[None])
    assert found is not None
    told = list(_at_places(made, calibration, found, np.random.default_rng([seed, 13])))
    if made.cell.robots["eye"].chain is not None and not calibration.robot_parameters:
        rng = np.random.default_rng([seed, 13])
        told += [{**each, "row": BUT_FOR_MOUNTS} for each in _at_places(made, calibration, found, rng, True)]
    return told


def _at_places(
    made: SimulatedCell,
    calibration: Calibration,
    found: ErrorMap,
    rng: np.random.Generator,
    but_for_mounts: bool = False,
) -> Iterator[dict[str, Any]]:
    low, high = found.points_m.min(0), found.points_m.max(0)
    corner = np.where(rng.random(3) < 0.5, low, high)
    believed = calibrated_kinematics(made.cell, calibration)
    for place, wanted in zip(PLACES, ((low + high) / 2, corner), strict=True):
        k = int(np.argmin(np.linalg.norm(found.points_m - wanted, axis=1)))
        meant = {robot: meant_pose(made, calibration, robot, found.points_m[k]) for robot in ("eye", "hand")}
        try:
            true = {robot: true_pose(made, believed, robot, *meant[robot], rng, but_for_mounts) for robot in meant}
        except NotConverged:
            continue
        eye, hand = true["eye"], made.truth[BASE] @ true["hand"]
        turn = (meant["eye"][0].inverse() @ calibration[BASE].mean @ meant["hand"][0]).rotvec
        off = eye.inverse() @ hand @ SE3.from_rotvec(turn, np.zeros(3)).inverse()
        yield {
            "row": "",
            "place": place,
            "mm": 1e3 * float(np.linalg.norm(hand.translation - eye.translation)),
            "deg": float(np.degrees(np.linalg.norm(off.rotvec))),
            "mm_95": 1e3 * float(found.length_95_m[k]),
            "deg_95": float(np.degrees(found.angle_95_rad[k])),
        }


def meant_pose(made: SimulatedCell, calibration: Calibration, robot: str, point_m: Array) -> tuple[SE3, int]:
    """Where a flange is told to be in its base, and the number of the sample whose turn it has."""
    in_base = point_m if robot == "eye" else calibration[BASE].mean.inverse() @ point_m
    poses = made.true_base_from_flange[robot]
    nearest = int(np.argmin(np.linalg.norm(poses.translation - in_base, axis=1)))
    return SE3(poses[nearest].rotation, in_base), nearest


def true_pose(
    made: SimulatedCell,
    believed: Mapping[str, Kinematics],
    robot: str,
    meant: SE3,
    nearest: int,
    rng: np.random.Generator,
    but_for_mounts: bool,
) -> SE3:
    """Where the flange truly is that is told to be somewhere."""
    stop = SE3.exp(rng.standard_normal(6) * np.repeat(NOISE, 3))
    chain, joints = made.cell.robots[robot].chain, made.recording.samples[nearest].robots[robot].joints_rad
    if chain is None or joints is None:
        return meant @ stop
    as_believed = believed.get(robot) or Kinematics(chain)
    for _ in range(3):  # of the chain as stated, corrected by what parameters move it
        moved = as_believed.forward(joints) @ chain.forward(joints).inverse()
        joints = inverse(chain, moved.inverse() @ meant, joints)
    everywhere = _everywhere_alike(made, as_believed, robot) if but_for_mounts else SE3.identity()
    return made.robots[robot].forward(joints) @ everywhere @ stop


def _everywhere_alike(made: SimulatedCell, believed: Kinematics, robot: str) -> SE3:
    """The shift of a flange, in its own axes, that brings where it truly was nearest to where it was believed to be.

    Iterated with a shift of the base, which the calibrated base holds: a right and a left shift between two sets of
    poses.
    """
    joints = np.array([sample.robots[robot].joints_rad for sample in made.recording.samples])
    true, believed_at = made.robots[robot].forward(joints), believed.forward(joints)
    right = left = SE3.identity()
    for _ in range(_ROUNDS):
        left = left @ SE3.exp(((left @ true @ right) @ believed_at.inverse()).inverse().log().mean(0))
        right = right @ SE3.exp(((left @ true @ right).inverse() @ believed_at).log().mean(0))
    return right


def summary(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Shares of trials within what was expected, by place."""
    told: dict[str, Any] = {}
    for place in PLACES:
        mine = [each for each in found if each["place"] == place]
        told[place] = {
            "trials": len(mine),
            "mm": float(np.mean([each["mm"] <= each["mm_95"] for each in mine])),
            "deg": float(np.mean([each["deg"] <= each["deg_95"] for each in mine])),
            "median_mm_95": float(np.median([each["mm_95"] for each in mine])),
        }
    return told


def row(kind: str, of: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    shares = [f"{100 * of[place][key]:.1f} %" for key in ("mm", "deg") for place in PLACES]
    expected = [f"{of[place]['median_mm_95']:.2f}" for place in PLACES]
    return kind, of[PLACES[0]]["trials"], *shares, *expected


def section(result: dict[str, Any]) -> str:
    """Of docs/benchmarks.md."""
    about = f"""\
Both flanges are sent to one point, at the middle of the map and at a corner. Are their distance and their angle within
the 95 % bounds of the map? Required: in {100 * LOW:g} to {100 * HIGH:g} % of up to {TRIALS} trials. The kinds of cells
are:

- `poses`: robots are recorded by poses. `stated` and `estimated` say whether their noise is stated.
- `joints, stated`: joints and links have errors, which are estimated with their priors.
- `joints, estimated`: the same errors, with the arms assumed to be as in the URDF, and no noise stated.
- `exact joints, estimated`: the arms are as in the URDF, which the calibration does not know.

The errors of an arm shift its flange by a part that is the same everywhere. The mount of the camera or target absorbs
this part, and no recording shows it. It is the larger part of the errors. The rows `but for mounts` leave it out. The
errors that recorded poses show determine how large it may be. No recording proves that an exact arm is exact, so that
bounds on lengths hold there more often than required."""
    return f"{about}\n\n{table(HEAD, [row(kind, of) for kind, of in result['rows'].items()])}"


def main(arguments: Sequence[str]) -> None:
    """Draw and print; of all trials results/error_map.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.error_map", description=__doc__)
    parser.add_argument("--trials", type=int, default=TRIALS, help="of each kind")
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=list(KINDS))
    parser.add_argument("--keep", type=Path, help="file in which trials are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept, rows = Kept(asked.keep), dict[str, Any]()
    for kind in asked.kinds:
        by_trial = [kept.of(f"{kind}#{seed}", partial(trial, kind, seed)) for seed in range(asked.trials)]
        found = [each for of in by_trial for each in of]
        for more in dict.fromkeys(each["row"] for each in found):
            rows[kind + more] = summary([each for each in found if each["row"] == more])
    print(table(HEAD, [row(kind, of) for kind, of in rows.items()]))
    if asked.keep is not None or (asked.trials >= TRIALS and set(asked.kinds) == set(KINDS)):
        write("error_map", {"rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
