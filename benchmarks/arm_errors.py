"""From which size on a recording can tell that arms are built otherwise than stated, and what the answer says then.

The cells, plans and noise of `benchmarks.capture`, without its images: corners have the detector's errors, joints
stop up to 30 microradians from where they were sent. Arms then have an error of a size at which an answer that knows
nothing of it moves by 5, 10 and 20 of its sigmas in that very cell, all noise known. A perfect test knows all noise and
looks for nothing but the parameters of that kind of error: it finds it as often as a non-central chi-square beats
chance, whose shift is what the recording says of the error beyond what base and mounts take up.
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
PIXEL_PX, STOP_RAD = 0.0075, 3e-5  # of the detector on such images, and of each joint at each stop
SIGMAS = (5.0, 10.0, 20.0)
CHANCE = 1e-3
# Parameters of two arms that a recording tells beside three free frames: a chain of twelve joints has 4 * 12 + 6, of
# which 18 are the frames; of the offsets, those of the first and the last joint of each arm are such.
FREEDOMS = {"joint-offsets": 8, "link-errors": 36, "backlash": 12, "sag": 12}
NAMES = {"joint-offsets": "robot-model", "link-errors": "robot-model", "backlash": "robot-model", "sag": "deflection"}
_STEP = 1e-6

Joints = dict[str, Array]
Move = Callable[[Joints], dict[str, SE3]]
"""Flanges, (n,) each, of arms whose joints are sent somewhere, (n, 6) each."""


@dataclass(frozen=True, eq=False)
class Design:
    """A cell without an error, and where its arms are sent, (n, 6) by arm [rad], in order."""

    world: World
    joints: Joints

    def camera_from_target(self, flanges: dict[str, SE3], frames: Sequence[SE3]) -> SE3:
        """By flanges and by tangents of base, camera's mount and target's mount."""
        base, camera, board = (
            self.world.truth[name] @ moved
            for name, moved in zip((BASE, "eye_flange_from_wrist", "hand_flange_from_board"), frames, strict=True)
        )
        return (flanges["eye"] @ camera).inverse() @ (base @ flanges["hand"] @ board)


@cache
def design(seed: int) -> Design | None:
    """The cell of a seed and its plan; None where its arms do not reach."""
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


def moved(of: Design, robots: dict[str, Kinematics], play_rad: float) -> Move:
    """How arms of some kinematics stand whose joints have play: each stops on the side it comes from."""
    return lambda joints: {
        name: robots[name].forward(each + 0.5 * play_rad * _sides(of, name)) for name, each in joints.items()
    }


def _sides(of: Design, robot: str) -> Array:
    way = np.diff(np.vstack([of.world.home[robot], of.joints[robot]]), axis=0)
    return np.where(way >= 0, 1.0, -1.0)


@dataclass(frozen=True, eq=False)
class Information:
    """What a recording says: of the frames (18, 18), and how views move with joints, (n, 6, 12), and its weights."""

    by_frames: Array
    weights: Array

    @property
    def frames(self) -> Array:
        """(18, 18)."""
        return np.asarray(np.einsum("nia,nij,njb->ab", self.by_frames, self.weights, self.by_frames))

    def pull(self, signal: Array) -> Array:
        """Of a signal (n, 6) on the frames, (18,)."""
        return np.asarray(np.einsum("nia,nij,nj->a", self.by_frames, self.weights, signal))

    def size(self, signal: Array) -> float:
        """Of a signal, squared."""
        return float(np.einsum("ni,nij,nj->", signal, self.weights, signal))


def information(of: Design) -> Information:
    """What the recording of a cell without an error says, all noise known."""
    plain = moved(of, dict(of.world.robots), 0.0)
    still = [SE3.identity()] * 3
    seen = of.camera_from_target(plain(of.joints), still)

    def by(change: Callable[[int], SE3], count: int) -> Array:
        return np.stack([(seen.inverse() @ change(k)).log() / _STEP for k in range(count)], axis=-1)

    def frames(k: int) -> SE3:
        steps = [SE3.exp(_STEP * (np.arange(6) == k - 6 * which)) for which in range(3)]
        return of.camera_from_target(plain(of.joints), steps)

    def joint(k: int) -> SE3:
        sent = {
            name: each + _STEP * (np.arange(6) == k - 6 * place) for place, (name, each) in enumerate(of.joints.items())
        }
        return of.camera_from_target(plain(sent), still)

    by_joints = by(joint, 12)
    covariance = STOP_RAD**2 * by_joints @ np.swapaxes(by_joints, 1, 2) + PIXEL_PX**2 * _of_view(of, seen)
    return Information(by(frames, 18), np.asarray(np.linalg.inv(covariance), dtype=np.float64))


def _of_view(of: Design, seen: SE3) -> Array:
    """Covariance of each view's own pose for corners of one pixel, (n, 6, 6)."""
    shape, lens = of.world.cell.targets["board"].target, of.world.lenses["wrist"]
    assert shape is not None
    found = []
    for k in range(SAMPLES):
        pose = seen[k]
        pixels = [
            lens.project(pose @ SE3.exp(sign * _STEP * row) @ shape.points) for row in np.eye(6) for sign in (1, -1)
        ]
        by = np.stack([(a - b).ravel() / (2 * _STEP) for a, b in zip(pixels[::2], pixels[1::2], strict=True)], axis=1)
        found.append(np.linalg.inv(by.T @ by))
    return np.stack(found)


def signal(of: Design, kind: str, size: float) -> Array:
    """How an error of a size, in SI, moves views, (n, 6)."""
    world, still = _faulty(of, kind, size / FAULTS[kind].scale), [SE3.identity()] * 3
    plain = of.camera_from_target(moved(of, dict(of.world.robots), 0.0)(of.joints), still)
    off = of.camera_from_target(moved(of, dict(world.robots), world.faults.size("backlash"))(of.joints), still)
    return np.asarray((plain.inverse() @ off).log())


def _faulty(of: Design, kind: str, size: float) -> World:
    faults = read_faults([f"{kind}={size!r}"]) if size else Faults()
    return faulty_world(of.world.cell, of.world.truth, of.world.home, faults, of.world.seed)


def recording(of: Design, kind: str, size: float) -> Recording:
    """What is seen of a cell with an error of a size in its own unit."""
    world, rng = _faulty(of, kind, size), np.random.default_rng([of.world.seed, 99])
    stood = {name: each + STOP_RAD * rng.standard_normal(each.shape) for name, each in of.joints.items()}
    flanges = moved(of, dict(world.robots), world.faults.size("backlash"))(stood)
    seen = of.camera_from_target(flanges, [SE3.identity()] * 3)
    shape, lens = of.world.cell.targets["board"].target, of.world.lenses["wrist"]
    assert shape is not None
    samples = []
    for k in range(SAMPLES):
        pose = seen[k]
        visible = lens.sees(pose @ shape.points)
        pixels = lens.project(pose @ shape.points)[visible]
        pixels = pixels + PIXEL_PX * rng.standard_normal(pixels.shape)
        found = PixelObservation(
            "wrist", "board", shape.ids[visible], pixels, np.full(len(pixels), PIXEL_PX), detected=True
        )
        states = {name: RobotState(joints_rad=each[k]) for name, each in of.joints.items()}
        samples.append(Sample(k, float(k), states, (found,)))
    return Recording(tuple(samples))


def measured(seed: int) -> Iterator[dict[str, Any]]:
    """One cell without an error, and with each of each size."""
    of = design(seed)
    if of is None:
        return
    said, kinds = information(of), ("", *FREEDOMS)
    of_frames = spectrum(said.frames).inverse
    for kind in kinds:
        unit, shift, base = 1.0, 0.0, 0.0
        if kind:
            small = 0.01 * FAULTS[kind].default_size * FAULTS[kind].scale
            moves = signal(of, kind, small) / small
            pulled = said.pull(moves)
            step = (of_frames @ pulled)[:6]
            base = float(np.sqrt(step @ np.linalg.solve(of_frames[:6, :6], step)))
            shift = said.size(moves) - float(pulled @ of_frames @ pulled)
            unit = FAULTS[kind].scale
        for sigmas in SIGMAS if kind else (0.0,):
            size = sigmas / base if kind else 0.0
            row = {"error": kind, "sigmas": sigmas, "seed": seed, "size": size / unit, "shift": size**2 * shift}
            yield {**row, **_answer(of, kind, size / unit)}


def _answer(of: Design, kind: str, size: float) -> dict[str, Any]:
    """What the calibration says."""
    calibration = calibrate(of.world.cell, recording(of, kind, size))
    names = [finding.code for finding in calibration.findings if finding.severity != "info"]
    said: dict[str, Any] = {"verdict": calibration.verdict, "first": names[0] if names else "", "nees": None}
    if BASE in calibration.transforms:
        estimate = calibration.transforms[BASE]
        error = (estimate.mean.inverse() @ of.world.truth[BASE]).log()
        said["nees"] = float(error @ np.linalg.solve(estimate.covariance, error))
    return said


HEAD = ("error", "sigmas", "size, median", "cells", "a perfect test finds", "named first", "good", "inside 99.7 %",
        "inside or named", "own sigmas, median")  # fmt: skip


def rows(found: Sequence[dict[str, Any]]) -> list[tuple[object, ...]]:
    """Lines of the table with `HEAD`."""
    keys = dict.fromkeys((each["error"], each["sigmas"]) for each in found)
    return [_row(*key, [each for each in found if (each["error"], each["sigmas"]) == key]) for key in keys]


def _row(kind: str, sigmas: float, of: Sequence[dict[str, Any]]) -> tuple[object, ...]:
    inside = [each["nees"] is not None and each["nees"] < chi2.ppf(0.997, 6) for each in of]
    named = [bool(kind) and each["verdict"] != "good" and each["first"] == NAMES[kind] for each in of]
    own = float(np.median([np.sqrt(each["nees"]) for each in of if each["nees"] is not None]))
    size, best = "", ""
    if kind:
        size = f"{np.median([each['size'] for each in of]):.2g} {FAULTS[kind].unit}"
        limit = chi2.isf(CHANCE, FREEDOMS[kind])
        best = f"{sum(float(ncx2.sf(limit, FREEDOMS[kind], each['shift'])) for each in of):.1f}"
    good = sum(each["verdict"] == "good" for each in of)
    either = sum(a or b for a, b in zip(inside, named, strict=True))
    return (kind or "none", f"{sigmas:g}", size, len(of), best, sum(named), good, sum(inside), either, f"{own:.1f}")


def shown(found: list[dict[str, Any]]) -> str:
    """The table."""
    return table(HEAD, rows(found))


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
Two simulated UR5e with free mounts take {SAMPLES} poses all around, as `basecal capture` plans them. Corners have
errors of {PIXEL_PX:g} px, and joints stop up to {1e6 * STOP_RAD:g} microradians from their commanded position.

- `sigmas` is the size of the error: so many sigmas move an answer that ignores it, with all noise known.
- A perfect test knows all noise, tests only for parameters of that kind, and has a false-alarm probability of
  {CHANCE:g}. No test of these recordings finds more.
- `own sigmas` is the error of the answer in the sigmas that it states. 2.3 is right."""
    return f"{about}\n\n{shown(result['rows'])}"


def main(arguments: Sequence[str]) -> None:
    """Measure cell by cell, write results/arm_errors.json after each of them, and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.arm_errors", description=__doc__)
    parser.add_argument("--cells", type=int, default=CELLS)
    parser.add_argument("--go-on", action="store_true", help="with the cells that results/arm_errors.json lacks")
    asked = parser.parse_args(arguments)
    path = RESULTS / "arm_errors.json"
    found: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["rows"] if asked.go_on else []
    for seed in sorted(set(range(asked.cells)) - {each["seed"] for each in found}):
        found += measured(seed)
        write("arm_errors", {"rows": found})
    print(shown(found))


if __name__ == "__main__":
    main(sys.argv[1:])
