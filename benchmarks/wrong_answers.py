"""Whether answers that are wrong pass for good, and whether what made them wrong is named first.

Cells of kinds that no stated sigma covers: arms whose lengths are off, clocks that lag, bases that step, stops that are
read back anew, rows that were copied, sigmas that are not so. Each kind is drawn afresh by seed. An answer is wrong
where the truth is outside its own 99.9 % ellipsoid.
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

BEYOND = 0.999
NOISE = (1e-4, 2e-4)
SAG_PER_M = 2e-3  # [rad/m]
PASSED, NAMED, CLEAN = 0.01, 0.9, 0.97
FEWEST = 30  # cells of each kind that results are written of


class Drawn(NamedTuple):
    """A cell, what was recorded in it, and the truth of its transforms."""

    cell: Cell
    recording: Recording
    truth: dict[str, SE3]


class Kind(NamedTuple):
    """How a kind is drawn, and the code of the finding that names its cause; "" where none is asked for."""

    draw: Callable[[int], Drawn]
    code: str = ""
    clean: bool = False


class Outcome(NamedTuple):
    """What became of one cell: squared Mahalanobis distance of the truth, and the codes, infos apart."""

    kind: str
    seed: int
    verdict: str
    wrong: bool
    first: str
    codes: list[str]
    off_mm: float
    nees: float
    seconds: float


def _scenario(seed: int, **changed: Any) -> Scenario:
    """Twenty to forty samples of two arms, noise of robots stated in every second cell."""
    usual = {"samples": 20 + 5 * (seed % 5), "robot_noise": NOISE, "state_robot_noise": seed % 2 == 0}
    return Scenario(**{**usual, **changed})


def _simulated(seed: int, **changed: Any) -> Drawn:
    made = simulate(_scenario(seed, **changed), 1000 + seed)
    return Drawn(made.cell, made.recording, dict(made.truth))


def _reread(drawn: Drawn, robot: str, recorded: Callable[[int, SE3], SE3]) -> Drawn:
    """The same with other recorded poses of a robot."""

    def read(k: int, sample: Sample) -> Sample:
        """One sample."""
        pose = sample.robots[robot].base_from_flange
        assert pose is not None
        return replace(sample, robots={**sample.robots, robot: RobotState(recorded(k, pose))})

    samples = tuple(read(k, s) for k, s in enumerate(drawn.recording.samples))
    return drawn._replace(recording=Recording(samples))


def _poses(recording: Recording, robot: str) -> list[SE3]:
    """What a robot's poses were read as."""
    poses = [s.robots[robot].base_from_flange for s in recording.samples]
    return [pose for pose in poses if pose is not None]


def clean(seed: int) -> Drawn:
    """As stated."""
    return _simulated(seed)


def clean_unstated(seed: int) -> Drawn:
    """No sigma stated."""
    return _simulated(seed, state_robot_noise=False, state_pixel_noise=False)


def clean_still(seed: int) -> Drawn:
    """One arm stands still, its mount is known."""
    arms, mount = [("eye_still", "camera_mount"), ("hand_still", "target_mount")][seed % 2]
    return _simulated(seed, arms=arms, **{mount: "fixed"})


def clean_path(seed: int) -> Drawn:
    """Taken while the arms move, the clocks alike."""
    return _on_path(seed, 0.0)


def scaled(seed: int) -> Drawn:
    """A robot's lengths are off by 0.1 %; the arms move by half a metre, where that shows."""
    factor = 1 + (1e-3 if seed % 4 < 2 else -1e-3)
    robot = ("hand", "eye")[seed // 2 % 2]
    drawn = _simulated(seed, samples=40 + 10 * (seed % 3), position_m=0.3, spread_rad=0.9)
    return _reread(drawn, robot, lambda k, pose: SE3(pose.rotation, factor * pose.translation))


def lagging(seed: int) -> Drawn:
    """The camera lags the arms by 20 to 60 ms on a continuous path."""
    return _on_path(seed, 0.02 + 0.01 * (seed % 5))


def _on_path(seed: int, lag_s: float) -> Drawn:
    """Sixty samples at ten a second, along smooth paths through random poses one and a half seconds apart."""
    scenario = _scenario(seed, samples=10, spread_rad=0.4, robot_noise=(0.0, 0.0) if seed % 2 else NOISE)
    scene_rng, motion_rng, noise_rng, prior_rng = np.random.default_rng(5000 + seed).spawn(4)
    scene = draw_scene(scenario, make_layout(scenario.layout), scene_rng)
    (way,) = draw_motions(scene, scenario, motion_rng, {})
    stamps = 0.15 + 0.2 * np.arange(60)
    recorded = {robot: _along(poses, stamps) for robot, poses in way.recorded.items()}
    seen_at = {robot: _along(poses, stamps - lag_s) for robot, poses in way.recorded.items()}
    noise = {robot: SE3.exp(motion_rng.standard_normal((60, 6)) * np.repeat(NOISE, 3)) for robot in seen_at}
    motion = Motion(0, recorded, {robot: seen_at[robot] @ noise[robot] for robot in seen_at})
    views = observe(motion, scene, replace(scenario, partial=True), noise_rng)
    samples = tuple(
        Sample(k, float(stamps[k]), {r: RobotState(p[k]) for r, p in recorded.items()}, observations)
        for k, observations in enumerate(views)
        if len(observations[0].ids) >= 8
    )
    cell = stated_cell(scene, scenario, prior_rng, {})
    return Drawn(cell, Recording(samples), dict(truth(scene, cell)))


def _along(way: SE3, times: np.ndarray) -> SE3:
    """Poses of a smooth path through poses 1.35 s apart."""
    knots = 1.35 * np.arange(len(way))
    about = way[0]
    tangents = CubicSpline(knots, (about.inverse() @ way).log())(times)
    return about @ SE3.exp(tangents)


def jittering(seed: int) -> Drawn:
    """Five views at each of twelve stops, whose read-back jitters by 2 to 20 um."""
    scenario = _scenario(seed, samples=12)
    made = simulate(scenario, 1000 + seed)
    jitter = (2e-6, 7e-6, 2e-5)[seed % 3]
    rng = np.random.default_rng(seed)
    times = np.repeat(np.arange(12), 5)
    recorded = {r: SE3.stack(_poses(made.recording, r))[times] for r in made.true_base_from_flange}
    motion = Motion(0, recorded, {r: poses[times] for r, poses in made.true_base_from_flange.items()})
    scene = draw_scene(scenario, make_layout(scenario.layout), np.random.default_rng(1000 + seed).spawn(5)[0])
    views = observe(motion, scene, scenario, rng)
    read = {r: poses @ SE3.exp(jitter * rng.standard_normal((60, 6))) for r, poses in recorded.items()}
    samples = tuple(Sample(k, float(k), {r: RobotState(p[k]) for r, p in read.items()}, v) for k, v in enumerate(views))
    return Drawn(made.cell, Recording(samples), dict(made.truth))


def copied(seed: int) -> Drawn:
    """Every row three times."""
    drawn = _simulated(seed, samples=15)
    count = len(drawn.recording.samples)
    rows = [
        replace(s, sample=s.sample + count * k, stamp_s=s.sample + 1.0 * count * k)
        for k in range(3)
        for s in drawn.recording.samples
    ]
    return drawn._replace(recording=Recording(tuple(rows)))


def stepped(seed: int) -> Drawn:
    """The hand's base moves by 1 mm halfway."""
    drawn = _simulated(seed)
    half = len(drawn.recording.samples) // 2
    direction = np.random.default_rng(seed).standard_normal(3)
    step = SE3(np.eye(3), 1e-3 * direction / np.linalg.norm(direction))
    return _reread(drawn, "hand", lambda k, pose: step @ pose if k >= half else pose)


def drifting(seed: int) -> Drawn:
    """The hand's base drifts by 2 mm from the first sample to the last."""
    drawn = _simulated(seed)
    count = len(drawn.recording.samples)
    direction = np.random.default_rng(seed).standard_normal(3)
    direction *= 2e-3 / np.linalg.norm(direction)
    return _reread(drawn, "hand", lambda k, pose: SE3(np.eye(3), k / count * direction) @ pose)


def sagging(seed: int) -> Drawn:
    """The hand's flange sags by 2 mrad a metre of reach, about the horizontal across it.

    What all poses have of it in common is a tilt of the base by definition: where the base is, the recorded poses say.
    """

    def sag(_: int, pose: SE3) -> SE3:
        """The pose as recorded, of an arm that is lower than that: it does not know that it sags."""
        reach = pose.translation * [1, 1, 0]
        turn = np.cross(reach, [0, 0, -1.0]) * SAG_PER_M
        up = SE3.exp(np.concatenate([np.zeros(3), -turn])).rotation
        return SE3(up @ pose.rotation, up @ pose.translation)

    drawn = _simulated(seed)
    read = _reread(drawn, "hand", sag)
    true, recorded = (SE3.stack(_poses(of.recording, "hand")) for of in (drawn, read))
    tilt = SE3.exp((true @ recorded.inverse()).log().mean(0))
    name = "eye_base_from_hand_base"
    return read._replace(truth=drawn.truth | {name: drawn.truth[name] @ tilt})


def optimistic(seed: int) -> Drawn:
    """The stated pixel sigma is 0.7 of the true one."""
    drawn = _simulated(seed)
    return drawn._replace(cell=replace(drawn.cell, pixel_px=0.14))


def off_centre(seed: int) -> Drawn:
    """The stated principal point is 10 px off, and fixed."""
    drawn = _simulated(seed)
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


def rounded(seed: int) -> Drawn:
    """Translations of both arms in whole millimetres."""
    drawn = _simulated(seed)
    for robot in ("eye", "hand"):
        drawn = _reread(drawn, robot, lambda k, pose: SE3(pose.rotation, np.round(pose.translation, 3)))
    return drawn


def common_shift(seed: int) -> Drawn:
    """All points of a view are off by the same 0.5 px, which nobody stated."""
    drawn = _simulated(seed, correlated_px=0.5)
    return drawn._replace(cell=replace(drawn.cell, correlated_px=None))


def reversed_order(seed: int) -> Drawn:
    """What the hand recorded stands in reverse order."""
    drawn = _simulated(seed)
    poses = _poses(drawn.recording, "hand")
    return _reread(drawn, "hand", lambda k, pose: poses[len(poses) - 1 - k])


def off_by_three(seed: int) -> Drawn:
    """What the hand recorded stands three samples late; the last three stand first."""
    drawn = _simulated(seed)
    poses = _poses(drawn.recording, "hand")
    return _reread(drawn, "hand", lambda k, pose: poses[k - 3])


def euler_order(seed: int) -> Drawn:
    """The hand's roll, pitch and yaw about fixed axes were read as angles about moving ones."""

    def read(_: int, pose: SE3) -> SE3:
        """A pose as it was read."""
        angles = Rotation.from_matrix(pose.rotation).as_euler("xyz")
        return SE3(Rotation.from_euler("XYZ", angles).as_matrix(), pose.translation)

    return _reread(_simulated(seed), "hand", read)


def shuffled(seed: int) -> Drawn:
    """What the hand recorded stands in any order."""
    drawn = _simulated(seed)
    poses = _poses(drawn.recording, "hand")
    order = np.random.default_rng(seed).permutation(len(poses))
    return _reread(drawn, "hand", lambda k, pose: poses[order[k]])


KINDS: dict[str, Kind] = {
    "clean": Kind(clean, clean=True),
    "clean, nothing stated": Kind(clean_unstated, clean=True),
    "clean, an arm still": Kind(clean_still, clean=True),
    "clean, in motion": Kind(clean_path, clean=True),
    "lengths 0.1 % off": Kind(scaled, "length-scale"),
    "camera lags": Kind(lagging, "clock-offset"),
    "read-back jitters": Kind(jittering, "same-stop"),
    "rows copied": Kind(copied, "duplicate-samples"),
    "base steps 1 mm": Kind(stepped, "base-moved"),
    "base drifts 2 mm": Kind(drifting, "drift"),
    "sag of 2 mrad a metre": Kind(sagging, "deflection"),
    "pixel sigma x 0.7": Kind(optimistic, "poor-fit"),
    "centre 10 px off": Kind(off_centre),
    "poses in whole mm": Kind(rounded, "rounded-poses"),
    "common shift 0.5 px": Kind(common_shift),
    "order reversed": Kind(reversed_order, "pairing-shifted"),
    "order off by three": Kind(off_by_three, "pairing-shifted"),
    "order of angles": Kind(euler_order, "euler-order"),
    "shuffled": Kind(shuffled, "poor-fit"),
}


def outcome(name: str, kind: Kind, seed: int) -> Outcome:
    """One cell, calibrated."""
    drawn = kind.draw(seed)
    began = time.perf_counter()
    found = calibrate(drawn.cell, drawn.recording)
    took = time.perf_counter() - began
    off, nees, beyond = _off(drawn, found)
    told = [f.code for f in found.findings if f.severity != "info" or f.code == kind.code]
    return Outcome(name, seed, found.verdict, beyond, next(iter(told), ""), told, off, nees, took)


def _off(drawn: Drawn, found: Calibration) -> tuple[float, float, bool]:
    """Of what was asked: the largest distance from the truth [mm], the largest squared Mahalanobis distance over its
    freedoms, and whether it is beyond chance.
    """
    off, worst, beyond = 0.0, 0.0, False
    for name in drawn.cell.requested_transforms:
        if name not in found.transforms or drawn.cell.transforms[name].status == "fixed":
            continue
        estimate = found.transforms[name]
        xi = (estimate.mean.inverse() @ drawn.truth[name]).log()
        width = 3 if name in found.points else 6
        nees = float(xi[:width] @ np.linalg.solve(estimate.covariance[:width, :width], xi[:width]))
        off, worst = max(off, 1e3 * float(np.linalg.norm(xi[:3]))), max(worst, nees / width)
        beyond |= bool(nees > chi2.ppf(BEYOND, width))
    return off, worst, beyond


def summary(outcomes: list[Outcome]) -> list[dict[str, Any]]:
    """By kind."""
    rows = []
    for name, kind in KINDS.items():
        of = [o for o in outcomes if o.kind == name]
        if of:
            rows.append(
                {
                    "kind": name,
                    "cells": len(of),
                    "good": sum(o.verdict == "good" for o in of),
                    "good_and_wrong": sum(o.verdict == "good" and o.wrong for o in of),
                    "wrong": sum(o.wrong for o in of),
                    "named": sum(o.first == kind.code for o in of) if kind.code else None,
                    "code": kind.code,
                    "median_off_mm": float(np.median([o.off_mm for o in of])),
                    "median_nees": float(np.median([o.nees for o in of])),
                    "median_s": float(np.median([o.seconds for o in of])),
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


def told(row: dict[str, Any]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    named = "" if row["named"] is None else row["named"]
    figures = (f"{row['median_off_mm']:.2f}", f"{row['median_nees']:.1f}", f"{row['median_s']:.2f}")
    return row["kind"], row["cells"], row["good"], row["good_and_wrong"], named, row["code"], *figures


def main(arguments: list[str]) -> None:
    """Run, print; of thirty cells and more of a kind results/wrong_answers.json too, beside what it has of others."""
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
        if asked.cells >= FEWEST:
            _keep(name, [o for o in outcomes if o.kind == name])
    print(table(HEAD, map(told, summary(outcomes))))


def _keep(name: str, outcomes: list[Outcome]) -> None:
    """Write what became of a kind's cells in place of what there was of it."""
    path = RESULTS / "wrong_answers.json"
    before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"rows": [], "outcomes": []}
    (row,) = summary(outcomes)
    rows = {each["kind"]: each for each in [*before["rows"], {**row, "commit": commit()}]}
    every = [o for o in before["outcomes"] if o["kind"] != name] + [o._asdict() for o in outcomes]
    asked_for = {"good_and_wrong": PASSED, "named": NAMED, "clean": CLEAN}
    write("wrong_answers", {
        "asked": asked_for,
        "rows": [rows[kind] for kind in KINDS if kind in rows],
        "outcomes": [o for kind in KINDS for o in every if o["kind"] == kind],
    })  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
