"""Smallest errors of arms that a recording can detect, and what the calibration answers if arms have errors.

Cells, plans and noise are those of `benchmarks.capture`, without its images. Corners have the detector's errors, and
joints stop up to 30 microradians from their commanded positions. An error of the arms has the size that moves an answer
which ignores it by 5, 10 and 20 of its sigmas in that cell, with all noise known.

A perfect test knows all noise and tests only for the parameters of that kind of error. Its power is that of a
chi-square test. The noncentrality is the information of the recording on the part of the error that base and mounts do
not absorb.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.stats import chi2, ncx2

from basecal.accuracy.calibrate import calibrate
from basecal.cell import PixelObservation, Recording, RobotState, Sample
from basecal.errors import BasecalError
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.geometry import SE3, Array
from basecal.numerics.spectral import spectrum
from basecal.planning import poses
from basecal.planning.sketch import sketch_cell
from basecal.simulation.running.faults import FAULTS, Faults, read_faults
from basecal.simulation.running.two_arms import two_arms
from basecal.simulation.running.world import World, faulty_world
from benchmarks.common import RESULTS, table, write

BASE = "eye_base_from_hand_base"
CELLS, SAMPLES = 40, 25
PIXEL_PX, STOP_RAD = 0.0075, 3e-5  # sigmas of the detector on such images, and of each joint at each stop
SIGMAS = (5.0, 10.0, 20.0)
CHANCE = 1e-3
# Observable parameters of two arms beside three free frames: a chain of twelve joints has 4 * 12 + 6, of which 18 are
# the frames. The frames absorb the offsets of the first and the last joint of each arm.
FREEDOMS = {"joint-offsets": 8, "link-errors": 36, "backlash": 12, "sag": 12}
NAMES = {"joint-offsets": "robot-model", "link-errors": "robot-model", "backlash": "robot-model", "sag": "deflection"}
_STEP = 1e-6

Joints = dict[str, Array]
FlangeModel = Callable[[Joints], dict[str, SE3]]
"""Flanges, (n,) each, by commanded joints, (n, 6) each."""


@dataclass(frozen=True, eq=False)
class Design:
    """A cell without an error, and the commanded joints of its arms, (n, 6) each [rad], in order."""

    world: World
    joints: Joints

    def camera_from_target(self, flanges: dict[str, SE3], frames: Sequence[SE3]) -> SE3:
        """Pose of the board in the camera, by flanges and by tangents of base, camera's mount and target's mount."""
        base, camera, board = (
            self.world.truth[name] @ frame
            for name, frame in zip((BASE, "eye_flange_from_wrist", "hand_flange_from_board"), frames, strict=True)
        )
        return (flanges["eye"] @ camera).inverse() @ (base @ flanges["hand"] @ board)


@cache
def make_design(seed: int) -> Design | None:
    """The cell of a seed and its plan; None if its arms do not reach."""
    try:
        world = two_arms("charuco", seed)
        sketch = sketch_cell(world.cell)
        home = {name: RobotState(joints_rad=joints) for name, joints in world.home.items()}
        plan = poses.plan(sketch, home, SAMPLES, seed)
    except BasecalError:
        return None
    sent = {name: np.stack([_joints(each.robots[name]) for each in plan]) for name in world.home}
    return Design(world, sent)


def _joints(state: RobotState) -> Array:
    assert state.joints_rad is not None
    return state.joints_rad


def flange_model(design: Design, robots: dict[str, Kinematics], play_rad: float) -> FlangeModel:
    """Forward kinematics of arms whose joints have play: each joint stops on the side that it comes from."""
    return lambda joints: {
        name: robots[name].forward(each + 0.5 * play_rad * _sides(design, name)) for name, each in joints.items()
    }


def _sides(design: Design, robot: str) -> Array:
    steps = np.diff(np.vstack([design.world.home[robot], design.joints[robot]]), axis=0)
    return np.where(steps >= 0, 1.0, -1.0)


@dataclass(frozen=True, eq=False)
class Information:
    """Information of a recording: Jacobians of its views by the frames, (n, 6, 18), and weights of views, (n, 6, 6)."""

    frame_jacobian: Array
    weights: Array

    @property
    def frame_information(self) -> Array:
        """Information about the frames, (18, 18)."""
        return np.asarray(np.einsum("nia,nij,njb->ab", self.frame_jacobian, self.weights, self.frame_jacobian))

    def frame_gradient(self, signal: Array) -> Array:
        """Weighted projection of a signal (n, 6) on the frames, (18,)."""
        return np.asarray(np.einsum("nia,nij,nj->a", self.frame_jacobian, self.weights, signal))

    def squared_norm(self, signal: Array) -> float:
        """Weighted squared norm of a signal (n, 6)."""
        return float(np.einsum("ni,nij,nj->", signal, self.weights, signal))


def information(design: Design) -> Information:
    """Information of the recording of a cell without an error, all noise known."""
    plain = flange_model(design, dict(design.world.robots), 0.0)
    still = [SE3.identity()] * 3
    views = design.camera_from_target(plain(design.joints), still)

    def derivative(change: Callable[[int], SE3], count: int) -> Array:
        return np.stack([(views.inverse() @ change(k)).log() / _STEP for k in range(count)], axis=-1)

    def frames(k: int) -> SE3:
        steps = [SE3.exp(_STEP * (np.arange(6) == k - 6 * index)) for index in range(3)]
        return design.camera_from_target(plain(design.joints), steps)

    def joint(k: int) -> SE3:
        sent = {
            name: each + _STEP * (np.arange(6) == k - 6 * index)
            for index, (name, each) in enumerate(design.joints.items())
        }
        return design.camera_from_target(plain(sent), still)

    joint_jacobian = derivative(joint, 12)
    covariance = STOP_RAD**2 * joint_jacobian @ np.swapaxes(joint_jacobian, 1, 2) + PIXEL_PX**2 * _view_covariances(
        design, views
    )
    return Information(derivative(frames, 18), np.asarray(np.linalg.inv(covariance), dtype=np.float64))


def _view_covariances(design: Design, camera_from_board: SE3) -> Array:
    """Covariance of the pose of each view alone, for corners with a noise of one pixel, (n, 6, 6)."""
    shape, lens = design.world.cell.targets["board"].target, design.world.lenses["wrist"]
    assert shape is not None
    covariances = []
    for k in range(SAMPLES):
        pose = camera_from_board[k]
        pixels = [
            lens.project(pose @ SE3.exp(sign * _STEP * row) @ shape.points) for row in np.eye(6) for sign in (1, -1)
        ]
        jacobian = np.stack(
            [(a - b).ravel() / (2 * _STEP) for a, b in zip(pixels[::2], pixels[1::2], strict=True)], axis=1
        )
        covariances.append(np.linalg.inv(jacobian.T @ jacobian))
    return np.stack(covariances)


def signal(design: Design, kind: str, size: float) -> Array:
    """Change of the views by an error of a size in SI units, (n, 6)."""
    world, still = _faulty(design, kind, size / FAULTS[kind].scale), [SE3.identity()] * 3
    plain = design.camera_from_target(flange_model(design, dict(design.world.robots), 0.0)(design.joints), still)
    faulty = design.camera_from_target(
        flange_model(design, dict(world.robots), world.faults.size("backlash"))(design.joints), still
    )
    return np.asarray((plain.inverse() @ faulty).log())


def _faulty(design: Design, kind: str, size: float) -> World:
    faults = read_faults([f"{kind}={size!r}"]) if size else Faults()
    return faulty_world(design.world.cell, design.world.truth, design.world.home, faults, design.world.seed)


def recording(design: Design, kind: str, size: float) -> Recording:
    """Simulate the recording of a cell with an error of a size in its own unit."""
    world, rng = _faulty(design, kind, size), np.random.default_rng([design.world.seed, 99])
    stopped = {name: each + STOP_RAD * rng.standard_normal(each.shape) for name, each in design.joints.items()}
    flanges = flange_model(design, dict(world.robots), world.faults.size("backlash"))(stopped)
    camera_from_board = design.camera_from_target(flanges, [SE3.identity()] * 3)
    shape, lens = design.world.cell.targets["board"].target, design.world.lenses["wrist"]
    assert shape is not None
    samples = []
    for k in range(SAMPLES):
        pose = camera_from_board[k]
        visible = lens.sees(pose @ shape.points)
        pixels = lens.project(pose @ shape.points)[visible]
        pixels = pixels + PIXEL_PX * rng.standard_normal(pixels.shape)
        observation = PixelObservation(
            "wrist", "board", shape.ids[visible], pixels, np.full(len(pixels), PIXEL_PX), detected=True
        )
        states = {name: RobotState(joints_rad=each[k]) for name, each in design.joints.items()}
        samples.append(Sample(k, float(k), states, (observation,)))
    return Recording(tuple(samples))


def measure(seed: int) -> Iterator[dict[str, Any]]:
    """Rows of one cell without an error, and with each kind and size of error."""
    design = make_design(seed)
    if design is None:
        return
    known, kinds = information(design), ("", *FREEDOMS)
    frame_covariance = spectrum(known.frame_information).inverse
    for kind in kinds:
        unit, shift, base = 1.0, 0.0, 0.0
        if kind:
            small = 0.01 * FAULTS[kind].default_size * FAULTS[kind].scale
            unit_signal = signal(design, kind, small) / small
            gradient = known.frame_gradient(unit_signal)
            step = (frame_covariance @ gradient)[:6]
            base = float(np.sqrt(step @ np.linalg.solve(frame_covariance[:6, :6], step)))
            shift = known.squared_norm(unit_signal) - float(gradient @ frame_covariance @ gradient)
            unit = FAULTS[kind].scale
        for sigmas in SIGMAS if kind else (0.0,):
            size = sigmas / base if kind else 0.0
            row = {"error": kind, "sigmas": sigmas, "seed": seed, "size": size / unit, "shift": size**2 * shift}
            yield {**row, **_answer(design, kind, size / unit)}


def _answer(design: Design, kind: str, size: float) -> dict[str, Any]:
    """Calibrate, and return the verdict, the first finding and the NEES of the base."""
    calibration = calibrate(design.world.cell, recording(design, kind, size))
    names = [finding.code for finding in calibration.findings if finding.severity != "info"]
    answer: dict[str, Any] = {"verdict": calibration.verdict, "first": names[0] if names else "", "nees": None}
    if BASE in calibration.transforms:
        estimate = calibration.transforms[BASE]
        error = (estimate.mean.inverse() @ design.world.truth[BASE]).log()
        answer["nees"] = float(error @ np.linalg.solve(estimate.covariance, error))
    return answer


HEAD = ("error", "sigmas", "size, median", "cells", "a perfect test finds", "named first", "good", "inside 99.7 %",
        "inside or named", "own sigmas, median")  # fmt: skip


def rows(results: Sequence[dict[str, Any]]) -> list[tuple[object, ...]]:
    """Lines of the table with `HEAD`."""
    keys = dict.fromkeys((each["error"], each["sigmas"]) for each in results)
    return [_row(*key, [each for each in results if (each["error"], each["sigmas"]) == key]) for key in keys]


def _row(kind: str, sigmas: float, cells: Sequence[dict[str, Any]]) -> tuple[object, ...]:
    inside = [each["nees"] is not None and each["nees"] < chi2.ppf(0.997, 6) for each in cells]
    named = [bool(kind) and each["verdict"] != "good" and each["first"] == NAMES[kind] for each in cells]
    own = float(np.median([np.sqrt(each["nees"]) for each in cells if each["nees"] is not None]))
    size, best = "", ""
    if kind:
        size = f"{np.median([each['size'] for each in cells]):.2g} {FAULTS[kind].unit}"
        limit = chi2.isf(CHANCE, FREEDOMS[kind])
        best = f"{sum(float(ncx2.sf(limit, FREEDOMS[kind], each['shift'])) for each in cells):.1f}"
    good = sum(each["verdict"] == "good" for each in cells)
    either = sum(a or b for a, b in zip(inside, named, strict=True))
    return (kind or "none", f"{sigmas:g}", size, len(cells), best, sum(named), good, sum(inside), either, f"{own:.1f}")


def format_table(results: list[dict[str, Any]]) -> str:
    """The table."""
    return table(HEAD, rows(results))


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
Two simulated UR5e with free mounts take {SAMPLES} poses all around, as `basecal capture` plans them. Corners have
errors of {PIXEL_PX:g} px, and joints stop up to {1e6 * STOP_RAD:g} microradians from their commanded position.

- `sigmas` is the size of the error: so many sigmas move an answer that ignores it, with all noise known.
- A perfect test knows all noise, tests only for parameters of that kind, and has a false-alarm probability of
  {CHANCE:g}. No test of these recordings finds more.
- `named first` counts warnings and errors. Errors of links that the covariance contains are named as an info.
- `own sigmas` is the error of the answer in the sigmas that it states. 2.3 is right."""
    return f"{about}\n\n{format_table(result['rows'])}"


def main(arguments: Sequence[str]) -> None:
    """Measure cell by cell, write results/arm_errors.json after each of them, and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.arm_errors", description=__doc__)
    parser.add_argument("--cells", type=int, default=CELLS)
    parser.add_argument("--go-on", action="store_true", help="with the cells that results/arm_errors.json lacks")
    asked = parser.parse_args(arguments)
    path = RESULTS / "arm_errors.json"
    results: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["rows"] if asked.go_on else []
    for seed in sorted(set(range(asked.cells)) - {each["seed"] for each in results}):
        results += measure(seed)
        write("arm_errors", {"rows": results})
    print(format_table(results))


if __name__ == "__main__":
    main(sys.argv[1:])
