"""Effects that move the data alike: whether a finding names the true one, both, or the wrong one alone.

Each cell has one of two effects, in turn: an arm that bends by its reach, seen by an LED, or a focal length that is
off; a robot whose poses are too short, or a board that is too large; a joint offset or a gear ratio of the same joint;
a base that moved at once or steadily. No noise is stated. A finding names an effect if its message does, as a warning.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Cell, Finding, Recording, RobotState
from basecal.geometry import SE3
from basecal.simulation import Scenario, SimulatedCell, simulate
from benchmarks.common import cell_by_cell, table

CELLS = 50  # of each pair
NOISE = (5e-5, 1e-4)
HEAD = ("the cell has", "cells", "named", "both named", "the other alone", "neither", "good, beyond 4 sigma")
BASE = "eye_base_from_hand_base"
Made = tuple[SimulatedCell, Cell, Recording]
Poses = Callable[[int, RobotState], RobotState]


def _read(made: SimulatedCell, robot: str, read: Poses) -> Recording:
    """The recording with a robot read otherwise."""
    samples = []
    for k, sample in enumerate(made.recording.samples):
        robots = {**sample.robots, robot: read(k, sample.robots[robot])}
        samples.append(replace(sample, robots=robots, stamp_s=float(k)))
    return Recording(tuple(samples))


def _scenario(**changed: Any) -> Scenario:
    return replace(
        Scenario(samples=40, robot_noise=NOISE, state_robot_noise=False, state_pixel_noise=False, position_m=0.25),
        **changed,
    )


def _lens_off(made: SimulatedCell, share: float) -> Cell:
    """The cell with focal lengths stated otherwise."""
    cameras = {}
    for name, camera in made.cell.cameras.items():
        lens = camera.intrinsics
        assert lens is not None
        assert lens.camera is not None
        stated = lens.camera.parameters * np.append([1 + share] * 2, np.ones(len(lens.camera.parameters) - 2))
        cameras[name] = replace(
            camera, intrinsics=replace(lens, camera=lens.camera.with_parameters(stated), exact=False)
        )
    return replace(made.cell, cameras=cameras)


def _bent(rng: np.random.Generator, seed: int) -> Made:
    made, sag = simulate(_scenario(target="led", samples=60), seed), rng.uniform(3e-3, 1e-2)

    def read(_: int, state: RobotState) -> RobotState:
        """As if it did not bend."""
        pose = state.base_from_flange
        assert pose is not None
        turn = np.concatenate([np.zeros(3), np.cross(pose.translation, [0, 0, -sag])])
        return RobotState(SE3.exp(turn).inverse() @ pose)

    return made, _lens_off(made, 0.0), _read(made, "hand", read)


def _focal(rng: np.random.Generator, seed: int) -> Made:
    made = simulate(_scenario(target="led", samples=60), seed)
    return made, _lens_off(made, float(rng.choice([-1, 1]) * rng.uniform(0.005, 0.02))), made.recording


def _short(rng: np.random.Generator, seed: int) -> Made:
    made, share = simulate(_scenario(layout="eye_in_hand"), seed), float(rng.choice([-1, 1]) * rng.uniform(0.005, 0.02))

    def read(_: int, state: RobotState) -> RobotState:
        """Too short, or too long."""
        pose = state.base_from_flange
        assert pose is not None
        return RobotState(SE3(pose.rotation, (1 - share) * pose.translation))

    return made, made.cell, _read(made, "arm", read)


def _large(rng: np.random.Generator, seed: int) -> Made:
    made, share = simulate(_scenario(layout="eye_in_hand"), seed), float(rng.choice([-1, 1]) * rng.uniform(0.005, 0.02))
    board = made.cell.targets["board"]
    shape = board.target
    assert shape is not None
    options = {key: value * (1 - share) if key.endswith("_m") else value for key, value in shape.options.items()}
    smaller = replace(shape, points=(1 - share) * shape.points, options=options)
    return made, replace(made.cell, targets={"board": replace(board, target=smaller)}), made.recording


def _joint(rng: np.random.Generator, seed: int, is_gear: bool) -> Made:
    made, joint = simulate(_scenario(joints=True), seed), int(rng.integers(1, 5))
    size = float(rng.choice([-1, 1]) * rng.uniform(2e-3, 8e-3))

    def read(_: int, state: RobotState) -> RobotState:
        """With a joint that is off, or turns by more."""
        joints = np.array(state.joints_rad)
        joints[joint] -= size * (joints[joint] if is_gear else 1)
        return RobotState(joints_rad=joints)

    return made, made.cell, _read(made, "hand", read)


def _moved(rng: np.random.Generator, seed: int, is_step: bool) -> Made:
    made = simulate(_scenario(), seed)
    size = rng.uniform(5e-4, 3e-3) * rng.standard_normal(6) / np.sqrt(6)
    at = int(rng.integers(10, 30))

    def read(k: int, state: RobotState) -> RobotState:
        """In a base that moved."""
        pose = state.base_from_flange
        assert pose is not None
        return RobotState(SE3.exp(size * (k >= at if is_step else k / 39)) @ pose)

    return made, made.cell, _read(made, "hand", read)


PAIRS: Mapping[tuple[str, str], tuple[Callable[[np.random.Generator, int], Made], ...]] = {
    ("bending", "focal length"): (_bent, _focal),
    ("robot's length", "board's size"): (_short, _large),
    ("joint offset", "gear ratio"): (lambda rng, s: _joint(rng, s, False), lambda rng, s: _joint(rng, s, True)),
    ("step", "drift"): (lambda rng, s: _moved(rng, s, True), lambda rng, s: _moved(rng, s, False)),
}
WORDS = {
    "bending": ("mrad per metre",),
    "focal length": ("fx is off", "intrinsics"),
    "robot's length": ("poses of arm are",),
    "board's size": ("board is",),
    "joint offset": ("is off by", "joint offsets", "joint_offsets"),
    "gear ratio": ("gear_ratio",),
    "step": ("at about sample",),
    "drift": ("drifts by",),
}


def measured(seed: int) -> Iterator[dict[str, Any]]:
    """One cell of each pair."""
    for pair, makers in PAIRS.items():
        rng = np.random.default_rng([seed, 31])
        made, cell, recording = makers[seed % 2](rng, 5000 + seed)
        found = calibrate(cell, recording)
        named = [effect for effect in pair if _is_named(effect, found.findings)]
        worst = 0.0
        for name, estimate in found.transforms.items():
            error = (estimate.mean.inverse() @ made.truth[name]).log()
            worst = max(worst, float(np.abs(error / np.sqrt(np.maximum(np.diag(estimate.covariance), 1e-30))).max()))
        warned = [f.code for f in found.findings if f.severity != "info"]
        true = pair[seed % 2]
        yield {"pair": pair, "true": true, "named": named, "verdict": found.verdict, "worst": worst, "codes": warned}


def _is_named(effect: str, findings: tuple[Finding, ...]) -> bool:
    warned = [finding.message.lower() for finding in findings if finding.severity != "info"]
    return any(words in message for message in warned for words in WORDS[effect])


def rows(found: list[dict[str, Any]]) -> Iterator[list[object]]:
    """A line for each effect."""
    for pair in PAIRS:
        for true in pair:
            of = [each for each in found if each["true"] == true]
            count = [
                sum(each["named"] == [true] for each in of),
                sum(len(each["named"]) == 2 for each in of),
                sum(len(each["named"]) == 1 and each["named"] != [true] for each in of),
                sum(not each["named"] for each in of),
                sum(each["verdict"] == "good" and each["worst"] > 4 for each in of),
            ]
            yield [true, len(of), *count]


def shown(found: list[dict[str, Any]]) -> str:
    """As a table."""
    return table(HEAD, rows(found))


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = """\
Each cell has one of two effects with nearly the same influence on the data. No noise is stated. `named`: a warning
names the true effect and not the other."""
    return f"{about}\n\n{shown(result['rows'])}"


if __name__ == "__main__":
    cell_by_cell("confounding", sys.argv[1:], CELLS, measured, shown)
