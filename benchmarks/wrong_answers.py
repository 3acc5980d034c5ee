"""Whether wrong answers are called good, and whether the cause of the error is named first.

The cells have errors that no stated sigma covers: arms with wrong lengths, lagging clocks, moving bases, stops with
jitter, copied rows, wrong sigmas. Each kind is drawn anew by seed. An answer is wrong if the truth is outside its own
99.9 % ellipsoid.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Cell, Recording, RobotState, Sample
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from basecal.simulation.layout import make_layout
from basecal.simulation.motion import Motion, draw_motions
from basecal.simulation.scene import draw_scene
from basecal.simulation.stated_cell import stated_cell, truth
from basecal.simulation.testbed import observe
from benchmarks.common import RESULTS, commit, table, write

WRONG_QUANTILE = 0.999
NOISE = (1e-4, 2e-4)
SAG_PER_M = 2e-3  # [rad/m]
MOST_PASSED, LEAST_NAMED, LEAST_GOOD = 0.01, 0.9, 0.97
FEWEST_CELLS = 30  # cells of each kind that results are written of


class Drawn(NamedTuple):
    """A cell, its recording, and the true transforms."""

    cell: Cell
    recording: Recording
    truth: dict[str, SE3]


class Kind(NamedTuple):
    """How a kind is drawn, and the code of the finding that names its cause; "" if none is required."""

    draw: Callable[[int], Drawn]
    code: str = ""
    clean: bool = False


class Outcome(NamedTuple):
    """One cell: error and squared Mahalanobis distance of the truth, and codes of findings without infos."""

    kind: str
    seed: int
    verdict: str
    wrong: bool
    first: str
    codes: list[str]
    off_mm: float
    nees: float
    seconds: float


def two_arm_scenario(seed: int, **changed: Any) -> Scenario:
    """Twenty to forty samples of two arms, noise of robots stated in every second cell."""
    usual = {"samples": 20 + 5 * (seed % 5), "robot_noise": NOISE, "state_robot_noise": seed % 2 == 0}
    return Scenario(**{**usual, **changed})


def _draw(seed: int, **changed: Any) -> Drawn:
    simulated = simulate(two_arm_scenario(seed, **changed), 1000 + seed)
    return Drawn(simulated.cell, simulated.recording, dict(simulated.truth))


def _with_poses(drawn: Drawn, robot: str, change: Callable[[int, SE3], SE3]) -> Drawn:
    """The same with changed poses of a robot."""

    def change_sample(k: int, sample: Sample) -> Sample:
        """The sample with a changed pose."""
        pose = sample.robots[robot].base_from_flange
        assert pose is not None
        return replace(sample, robots={**sample.robots, robot: RobotState(change(k, pose))})

    samples = tuple(change_sample(k, s) for k, s in enumerate(drawn.recording.samples))
    return drawn._replace(recording=Recording(samples))


def _poses(recording: Recording, robot: str) -> list[SE3]:
    """Recorded poses of a robot."""
    poses = [s.robots[robot].base_from_flange for s in recording.samples]
    return [pose for pose in poses if pose is not None]


def clean(seed: int) -> Drawn:
    """A cell as stated."""
    return _draw(seed)


def clean_unstated(seed: int) -> Drawn:
    """A cell with no sigma stated."""
    return _draw(seed, state_robot_noise=False, state_pixel_noise=False)


def clean_still(seed: int) -> Drawn:
    """One arm stands still, and its mount is known."""
    arms, mount = [("eye_still", "camera_mount"), ("hand_still", "target_mount")][seed % 2]
    return _draw(seed, arms=arms, **{mount: "fixed"})


def clean_path(seed: int) -> Drawn:
    """A recording in motion with equal clocks."""
    return _record_motion(seed, 0.0)


def scaled_lengths(seed: int) -> Drawn:
    """A robot's lengths are off by 0.1 %; the arms move by half a metre, so that it shows."""
    factor = 1 + (1e-3 if seed % 4 < 2 else -1e-3)
    robot = ("hand", "eye")[seed // 2 % 2]
    drawn = _draw(seed, samples=40 + 10 * (seed % 3), position_m=0.3, spread_rad=0.9)
    return _with_poses(drawn, robot, lambda k, pose: SE3(pose.rotation, factor * pose.translation))


def lagging_camera(seed: int) -> Drawn:
    """The camera lags the arms by 20 to 60 ms on a continuous path."""
    return _record_motion(seed, 0.02 + 0.01 * (seed % 5))


def _record_motion(seed: int, lag_s: float) -> Drawn:
    """Sixty samples at 5 Hz, along smooth paths through random poses."""
    scenario = two_arm_scenario(seed, samples=10, spread_rad=0.4, robot_noise=(0.0, 0.0) if seed % 2 else NOISE)
    scene_rng, motion_rng, noise_rng, prior_rng = np.random.default_rng(5000 + seed).spawn(4)
    scene = draw_scene(scenario, make_layout(scenario.layout), scene_rng)
    (path,) = draw_motions(scene, scenario, motion_rng, {})
    stamps = 0.15 + 0.2 * np.arange(60)
    recorded = {robot: path_poses(poses, stamps) for robot, poses in path.recorded.items()}
    true_poses = {robot: path_poses(poses, stamps - lag_s) for robot, poses in path.recorded.items()}
    noise = {robot: SE3.exp(motion_rng.standard_normal((60, 6)) * np.repeat(NOISE, 3)) for robot in true_poses}
    motion = Motion(0, recorded, {robot: true_poses[robot] @ noise[robot] for robot in true_poses})
    views = observe(motion, scene, replace(scenario, partial=True), noise_rng)
    samples = tuple(
        Sample(k, float(stamps[k]), {r: RobotState(p[k]) for r, p in recorded.items()}, observations)
        for k, observations in enumerate(views)
        if len(observations[0].ids) >= 8
    )
    cell = stated_cell(scene, scenario, prior_rng, {})
    return Drawn(cell, Recording(samples), dict(truth(scene, cell)))


def path_poses(poses: SE3, times: np.ndarray) -> SE3:
    """Poses of a smooth path through poses 1.35 s apart."""
    knots = 1.35 * np.arange(len(poses))
    first = poses[0]
    tangents = CubicSpline(knots, (first.inverse() @ poses).log())(times)
    return first @ SE3.exp(tangents)


def jittering_stops(seed: int) -> Drawn:
    """Five views at each of twelve stops, whose recorded poses jitter by 2 to 20 um."""
    scenario = two_arm_scenario(seed, samples=12)
    simulated = simulate(scenario, 1000 + seed)
    jitter = (2e-6, 7e-6, 2e-5)[seed % 3]
    rng = np.random.default_rng(seed)
    times = np.repeat(np.arange(12), 5)
    recorded = {r: SE3.stack(_poses(simulated.recording, r))[times] for r in simulated.true_base_from_flange}
    motion = Motion(0, recorded, {r: poses[times] for r, poses in simulated.true_base_from_flange.items()})
    scene = draw_scene(scenario, make_layout(scenario.layout), np.random.default_rng(1000 + seed).spawn(5)[0])
    views = observe(motion, scene, scenario, rng)
    jittered = {r: poses @ SE3.exp(jitter * rng.standard_normal((60, 6))) for r, poses in recorded.items()}
    samples = tuple(
        Sample(k, float(k), {r: RobotState(p[k]) for r, p in jittered.items()}, v) for k, v in enumerate(views)
    )
    return Drawn(simulated.cell, Recording(samples), dict(simulated.truth))


def copied_rows(seed: int) -> Drawn:
    """Every row occurs three times."""
    drawn = _draw(seed, samples=15)
    count = len(drawn.recording.samples)
    rows = [
        replace(s, sample=s.sample + count * k, stamp_s=s.sample + 1.0 * count * k)
        for k in range(3)
        for s in drawn.recording.samples
    ]
    return drawn._replace(recording=Recording(tuple(rows)))


def stepping_base(seed: int) -> Drawn:
    """The hand's base moves by 1 mm halfway."""
    drawn = _draw(seed)
    half = len(drawn.recording.samples) // 2
    direction = np.random.default_rng(seed).standard_normal(3)
    step = SE3(np.eye(3), 1e-3 * direction / np.linalg.norm(direction))
    return _with_poses(drawn, "hand", lambda k, pose: step @ pose if k >= half else pose)


def drifting_base(seed: int) -> Drawn:
    """The hand's base drifts by 2 mm from the first sample to the last."""
    drawn = _draw(seed)
    count = len(drawn.recording.samples)
    direction = np.random.default_rng(seed).standard_normal(3)
    direction *= 2e-3 / np.linalg.norm(direction)
    return _with_poses(drawn, "hand", lambda k, pose: SE3(np.eye(3), k / count * direction) @ pose)


def sagging_arm(seed: int) -> Drawn:
    """The hand's flange sags by 2 mrad a metre of reach, about the horizontal axis across it.

    The part that all poses share is a tilt of the base by definition, since recorded poses define the base.
    """

    def sag(_: int, pose: SE3) -> SE3:
        """The recorded pose of an arm that sags: it does not contain the sag."""
        reach = pose.translation * [1, 1, 0]
        turn = np.cross(reach, [0, 0, -1.0]) * SAG_PER_M
        up = SE3.exp(np.concatenate([np.zeros(3), -turn])).rotation
        return SE3(up @ pose.rotation, up @ pose.translation)

    drawn = _draw(seed)
    sagging = _with_poses(drawn, "hand", sag)
    true, recorded = (SE3.stack(_poses(case.recording, "hand")) for case in (drawn, sagging))
    tilt = SE3.exp((true @ recorded.inverse()).log().mean(0))
    name = "eye_base_from_hand_base"
    return sagging._replace(truth=drawn.truth | {name: drawn.truth[name] @ tilt})


def small_pixel_sigma(seed: int) -> Drawn:
    """The stated pixel sigma is 0.7 of the true one."""
    drawn = _draw(seed)
    return drawn._replace(cell=replace(drawn.cell, pixel_px=0.14))


def shifted_centre(seed: int) -> Drawn:
    """The principal point is stated as fixed, 10 px off."""
    drawn = _draw(seed)
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    camera = drawn.cell.cameras["wrist"]
    assert camera.intrinsics is not None
    assert camera.intrinsics.camera is not None
    lens = camera.intrinsics.camera
    wrong = lens.with_parameters(
        lens.parameters + np.concatenate([[0, 0, 10 * np.cos(angle), 10 * np.sin(angle)], 0 * lens.distortion])
    )
    changed = replace(camera, intrinsics=replace(camera.intrinsics, camera=wrong, exact=False))
    return drawn._replace(cell=replace(drawn.cell, cameras={"wrist": changed}))


def rounded_poses(seed: int) -> Drawn:
    """Translations of both arms in whole millimetres."""
    drawn = _draw(seed)
    for robot in ("eye", "hand"):
        drawn = _with_poses(drawn, robot, lambda k, pose: SE3(pose.rotation, np.round(pose.translation, 3)))
    return drawn


def common_shift(seed: int) -> Drawn:
    """All points of a view have the same error of 0.5 px, which is not stated."""
    drawn = _draw(seed, correlated_px=0.5)
    return drawn._replace(cell=replace(drawn.cell, correlated_px=None))


def reversed_order(seed: int) -> Drawn:
    """The hand's poses are in reverse order."""
    drawn = _draw(seed)
    poses = _poses(drawn.recording, "hand")
    return _with_poses(drawn, "hand", lambda k, pose: poses[len(poses) - 1 - k])


def late_poses(seed: int) -> Drawn:
    """The hand's poses are three samples late; the last three come first."""
    drawn = _draw(seed)
    poses = _poses(drawn.recording, "hand")
    return _with_poses(drawn, "hand", lambda k, pose: poses[k - 3])


def euler_order(seed: int) -> Drawn:
    """The hand's roll, pitch and yaw about fixed axes were read as angles about moving ones."""

    def misread(_: int, pose: SE3) -> SE3:
        """The pose with its angles in the wrong order."""
        angles = Rotation.from_matrix(pose.rotation).as_euler("xyz")
        return SE3(Rotation.from_euler("XYZ", angles).as_matrix(), pose.translation)

    return _with_poses(_draw(seed), "hand", misread)


def shuffled_poses(seed: int) -> Drawn:
    """The hand's poses are in random order."""
    drawn = _draw(seed)
    poses = _poses(drawn.recording, "hand")
    order = np.random.default_rng(seed).permutation(len(poses))
    return _with_poses(drawn, "hand", lambda k, pose: poses[order[k]])


KINDS: dict[str, Kind] = {
    "clean": Kind(clean, clean=True),
    "clean, nothing stated": Kind(clean_unstated, clean=True),
    "clean, an arm still": Kind(clean_still, clean=True),
    "clean, in motion": Kind(clean_path, clean=True),
    "lengths 0.1 % off": Kind(scaled_lengths, "length-scale"),
    "camera lags": Kind(lagging_camera, "clock-offset"),
    "read-back jitters": Kind(jittering_stops, "same-stop"),
    "rows copied": Kind(copied_rows, "duplicate-samples"),
    "base steps 1 mm": Kind(stepping_base, "base-moved"),
    "base drifts 2 mm": Kind(drifting_base, "drift"),
    "sag of 2 mrad a metre": Kind(sagging_arm, "deflection"),
    "pixel sigma x 0.7": Kind(small_pixel_sigma, "poor-fit"),
    "centre 10 px off": Kind(shifted_centre),
    "poses in whole mm": Kind(rounded_poses, "rounded-poses"),
    "common shift 0.5 px": Kind(common_shift),
    "order reversed": Kind(reversed_order, "pairing-shifted"),
    "order off by three": Kind(late_poses, "pairing-shifted"),
    "order of angles": Kind(euler_order, "euler-order"),
    "shuffled": Kind(shuffled_poses, "poor-fit"),
}


def outcome(name: str, kind: Kind, seed: int) -> Outcome:
    """Calibrate one cell."""
    drawn = kind.draw(seed)
    began = time.perf_counter()
    calibration = calibrate(drawn.cell, drawn.recording)
    took = time.perf_counter() - began
    off_mm, nees, is_wrong = _largest_errors(drawn, calibration)
    codes = [f.code for f in calibration.findings if f.severity != "info" or f.code == kind.code]
    return Outcome(name, seed, calibration.verdict, is_wrong, next(iter(codes), ""), codes, off_mm, nees, took)


def _largest_errors(drawn: Drawn, calibration: Calibration) -> tuple[float, float, bool]:
    """Errors of the requested transforms.

    Returns:
        The largest distance from the truth [mm], the largest squared Mahalanobis distance over its freedoms, and
        whether any one is beyond its ellipsoid.
    """
    off_mm, worst, is_wrong = 0.0, 0.0, False
    for name in drawn.cell.requested_transforms:
        if name not in calibration.transforms or drawn.cell.transforms[name].status == "fixed":
            continue
        estimate = calibration.transforms[name]
        xi = (estimate.mean.inverse() @ drawn.truth[name]).log()
        width = 3 if name in calibration.points else 6
        nees = float(xi[:width] @ np.linalg.solve(estimate.covariance[:width, :width], xi[:width]))
        off_mm, worst = max(off_mm, 1e3 * float(np.linalg.norm(xi[:3]))), max(worst, nees / width)
        is_wrong |= bool(nees > chi2.ppf(WRONG_QUANTILE, width))
    return off_mm, worst, is_wrong


def summary(outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """Statistics by kind."""
    rows = []
    for name, kind in KINDS.items():
        chosen = [o for o in outcomes if o.kind == name]
        if chosen:
            rows.append(
                {
                    "kind": name,
                    "cells": len(chosen),
                    "good": sum(o.verdict == "good" for o in chosen),
                    "good_and_wrong": sum(o.verdict == "good" and o.wrong for o in chosen),
                    "wrong": sum(o.wrong for o in chosen),
                    "named": sum(o.first == kind.code for o in chosen) if kind.code else None,
                    "code": kind.code,
                    "median_off_mm": float(np.median([o.off_mm for o in chosen])),
                    "median_nees": float(np.median([o.nees for o in chosen])),
                    "median_s": float(np.median([o.seconds for o in chosen])),
                }
            )
    return rows


HEAD = (
    "kind",
    "cells",
    "good",
    "good and wrong",
    "named first",
    "code",
    "error, median [mm]",
    "NEES/6, median",
    "time, median [s]",
)


def row(result: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    named = "" if result["named"] is None else result["named"]
    figures = (f"{result['median_off_mm']:.2f}", f"{result['median_nees']:.1f}", f"{result['median_s']:.2f}")
    return result["kind"], result["cells"], result["good"], result["good_and_wrong"], named, result["code"], *figures


def main(arguments: list[str]) -> None:
    """Run, print; with thirty cells or more of a kind update results/wrong_answers.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.wrong_answers", description=__doc__)
    parser.add_argument("--kinds", nargs="*", default=[], metavar="KIND", help="kinds of cells")
    parser.add_argument("--cells", type=int, default=40, help="so many of each kind")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--verbose", action="store_true", help="a line for each cell")
    asked = parser.parse_args(arguments)
    outcomes = []
    for name, kind in KINDS.items():
        if asked.kinds and name not in asked.kinds:
            continue
        for seed in range(asked.first, asked.first + asked.cells):
            outcomes.append(outcome(name, kind, seed))
            if asked.verbose:
                print(outcomes[-1], flush=True)
        if asked.cells >= FEWEST_CELLS:
            _store_rows(name, [o for o in outcomes if o.kind == name])
    print(table(HEAD, map(row, summary(outcomes))))


def _store_rows(name: str, outcomes: list[Outcome]) -> None:
    """Write the results of a kind in place of the previous ones."""
    path = RESULTS / "wrong_answers.json"
    before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"rows": [], "outcomes": []}
    (row,) = summary(outcomes)
    rows = {each["kind"]: each for each in [*before["rows"], {**row, "commit": commit()}]}
    all_outcomes = [o for o in before["outcomes"] if o["kind"] != name] + [o._asdict() for o in outcomes]
    required = {"good_and_wrong": MOST_PASSED, "named": LEAST_NAMED, "clean": LEAST_GOOD}
    write("wrong_answers", {
        "asked": required,
        "rows": [rows[kind] for kind in KINDS if kind in rows],
        "outcomes": [o for kind in KINDS for o in all_outcomes if o["kind"] == kind],
    })  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
