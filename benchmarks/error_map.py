"""Whether the map of expected errors holds the true ones: both flanges sent to one point, on simulated cells.

Cells of two arms are solved from 25 samples. At the middle of the box of the map and at one of its corners both robots
are commanded to bring their flanges to the same point, with the rotation of the nearest recorded pose. The distance of
the flanges should be within the 95 % bound of the map, and so should the angle between the true and the commanded
relative rotation.

`poses`: robots recorded by poses, off by 0.1 mm and 0.2 mrad per axis and stop. `joints`: arms of six axes that also
have offsets of 0.05 deg, and links off by 0.1 mm and 0.2 mrad. `stated`: all sigmas are stated, and offsets and links
are estimated. `estimated`: nothing is stated, and arms are assumed to be as in the URDF, as `exact joints` are.

The mount absorbs the part of an arm's errors that shifts its flange by a constant, and no recording shows it.
`but for mounts` is the same without this part.
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
_ALTERNATIONS = 10
LOW, HIGH = 0.92, 0.98  # required share within the bound
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


def as_calibration(simulated: SimulatedCell, solution: Solution) -> Calibration:
    """The solution as a calibration with all that the map needs."""
    return Calibration(
        "good",
        dict(solution.transforms),
        noise=noise_summary(simulated.cell, simulated.recording, solution),
        robot_parameters=robot_parameters(solution),
    )


def trial(kind: str, seed: int) -> list[dict[str, Any]]:
    """Rows of one cell: the true and the expected error at each place that both arms reach."""
    simulated = simulate(KINDS[kind], 40_000 + seed)
    solution = solve(simulated.cell, simulated.recording, Settings(robot_noise="estimated"))
    calibration = as_calibration(simulated, solution)
    point = simulated.truth[BASE].translation / 2
    grid = error_map(calibration, ArmErrors(simulated.cell, solution, solution), point[None])
    assert grid is not None
    rows = list(_place_rows(simulated, calibration, grid, np.random.default_rng([seed, 13])))
    if simulated.cell.robots["eye"].chain is not None and not calibration.robot_parameters:
        rng = np.random.default_rng([seed, 13])
        rows += [{**each, "row": BUT_FOR_MOUNTS} for each in _place_rows(simulated, calibration, grid, rng, True)]
    return rows


def _place_rows(
    simulated: SimulatedCell,
    calibration: Calibration,
    grid: ErrorMap,
    rng: np.random.Generator,
    but_for_mounts: bool = False,
) -> Iterator[dict[str, Any]]:
    low, high = grid.points_m.min(0), grid.points_m.max(0)
    corner = np.where(rng.random(3) < 0.5, low, high)
    kinematics = calibrated_kinematics(simulated.cell, calibration)
    for place, goal in zip(PLACES, ((low + high) / 2, corner), strict=True):
        k = int(np.argmin(np.linalg.norm(grid.points_m - goal, axis=1)))
        commanded = {
            robot: commanded_pose(simulated, calibration, robot, grid.points_m[k]) for robot in ("eye", "hand")
        }
        try:
            true = {
                robot: true_pose(simulated, kinematics, robot, *commanded[robot], rng, but_for_mounts)
                for robot in commanded
            }
        except NotConverged:
            continue
        eye, hand = true["eye"], simulated.truth[BASE] @ true["hand"]
        turn = (commanded["eye"][0].inverse() @ calibration[BASE].mean @ commanded["hand"][0]).rotvec
        off = eye.inverse() @ hand @ SE3.from_rotvec(turn, np.zeros(3)).inverse()
        yield {
            "row": "",
            "place": place,
            "mm": 1e3 * float(np.linalg.norm(hand.translation - eye.translation)),
            "deg": float(np.degrees(np.linalg.norm(off.rotvec))),
            "mm_95": 1e3 * float(grid.length_95_m[k]),
            "deg_95": float(np.degrees(grid.angle_95_rad[k])),
        }


def commanded_pose(simulated: SimulatedCell, calibration: Calibration, robot: str, point_m: Array) -> tuple[SE3, int]:
    """Commanded pose of a flange in its base, and the index of the sample that has its rotation."""
    position = point_m if robot == "eye" else calibration[BASE].mean.inverse() @ point_m
    poses = simulated.true_base_from_flange[robot]
    nearest = int(np.argmin(np.linalg.norm(poses.translation - position, axis=1)))
    return SE3(poses[nearest].rotation, position), nearest


def true_pose(
    simulated: SimulatedCell,
    kinematics: Mapping[str, Kinematics],
    robot: str,
    commanded: SE3,
    nearest: int,
    rng: np.random.Generator,
    but_for_mounts: bool,
) -> SE3:
    """True pose of a flange for a commanded pose."""
    stop = SE3.exp(rng.standard_normal(6) * np.repeat(NOISE, 3))
    chain, joints = simulated.cell.robots[robot].chain, simulated.recording.samples[nearest].robots[robot].joints_rad
    if chain is None or joints is None:
        return commanded @ stop
    calibrated = kinematics.get(robot) or Kinematics(chain)
    for _ in range(3):  # of the chain as stated, corrected by what parameters move it
        correction = calibrated.forward(joints) @ chain.forward(joints).inverse()
        joints = inverse(chain, correction.inverse() @ commanded, joints)
    constant = _constant_shift(simulated, calibrated, robot) if but_for_mounts else SE3.identity()
    return simulated.robots[robot].forward(joints) @ constant @ stop


def _constant_shift(simulated: SimulatedCell, calibrated: Kinematics, robot: str) -> SE3:
    """The shift of a flange, in its own axes, that best aligns its true poses with the calibrated kinematics.

    It alternates with a shift of the base, which the calibrated base absorbs: a right and a left shift between two sets
    of poses.
    """
    joints = np.array([sample.robots[robot].joints_rad for sample in simulated.recording.samples])
    true_poses, calibrated_poses = simulated.robots[robot].forward(joints), calibrated.forward(joints)
    right = left = SE3.identity()
    for _ in range(_ALTERNATIONS):
        left = left @ SE3.exp(((left @ true_poses @ right) @ calibrated_poses.inverse()).inverse().log().mean(0))
        right = right @ SE3.exp(((left @ true_poses @ right).inverse() @ calibrated_poses).log().mean(0))
    return right


def summary(trials: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Shares of trials within the expected errors, by place."""
    shares: dict[str, Any] = {}
    for place in PLACES:
        at_place = [each for each in trials if each["place"] == place]
        shares[place] = {
            "trials": len(at_place),
            "mm": float(np.mean([each["mm"] <= each["mm_95"] for each in at_place])),
            "deg": float(np.mean([each["deg"] <= each["deg_95"] for each in at_place])),
            "median_mm_95": float(np.median([each["mm_95"] for each in at_place])),
        }
    return shares


def row(kind: str, shares: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    within = [f"{100 * shares[place][key]:.1f} %" for key in ("mm", "deg") for place in PLACES]
    expected = [f"{shares[place]['median_mm_95']:.2f}" for place in PLACES]
    return kind, shares[PLACES[0]]["trials"], *within, *expected


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
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
    return f"{about}\n\n{table(HEAD, [row(kind, shares) for kind, shares in result['rows'].items()])}"


def main(arguments: Sequence[str]) -> None:
    """Draw and print; with all trials write results/error_map.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.error_map", description=__doc__)
    parser.add_argument("--trials", type=int, default=TRIALS, help="of each kind")
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=list(KINDS))
    parser.add_argument("--keep", type=Path, help="file in which trials are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept, rows = Kept(asked.keep), dict[str, Any]()
    for kind in asked.kinds:
        by_trial = [kept.of(f"{kind}#{seed}", partial(trial, kind, seed)) for seed in range(asked.trials)]
        results = [each for rows_of_cell in by_trial for each in rows_of_cell]
        for suffix in dict.fromkeys(each["row"] for each in results):
            rows[kind + suffix] = summary([each for each in results if each["row"] == suffix])
    print(table(HEAD, [row(kind, shares) for kind, shares in rows.items()]))
    if asked.keep is not None or (asked.trials >= TRIALS and set(asked.kinds) == set(KINDS)):
        write("error_map", {"rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
