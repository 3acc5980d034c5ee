"""Effects with nearly the same influence on the data: whether findings name the true one, both, or only the wrong one.

Each cell has one of two effects, in turn: an arm that bends by its reach, seen by an LED, or a wrong focal length; a
robot whose poses are too short, or a board that is too large; a joint offset or a gear ratio of the same joint; a base
that moved at once or steadily. No noise is stated. A finding names an effect if its message does, as a warning.
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
from benchmarks.common import run_cells, table

CELLS = 50  # of each pair
NOISE = (5e-5, 1e-4)
HEAD = ("the cell has", "cells", "named", "both named", "the other alone", "neither", "good, beyond 4 sigma")
BASE = "eye_base_from_hand_base"
Case = tuple[SimulatedCell, Cell, Recording]
StateChange = Callable[[int, RobotState], RobotState]


def _with_poses(simulated: SimulatedCell, robot: str, change: StateChange) -> Recording:
    """The recording with the states of a robot changed."""
    samples = []
    for k, sample in enumerate(simulated.recording.samples):
        robots = {**sample.robots, robot: change(k, sample.robots[robot])}
        samples.append(replace(sample, robots=robots, stamp_s=float(k)))
    return Recording(tuple(samples))


def _scenario(**changed: Any) -> Scenario:
    return replace(
        Scenario(samples=40, robot_noise=NOISE, state_robot_noise=False, state_pixel_noise=False, position_m=0.25),
        **changed,
    )


def _with_focal_error(simulated: SimulatedCell, share: float) -> Cell:
    """The cell with wrong focal lengths stated."""
    cameras = {}
    for name, camera in simulated.cell.cameras.items():
        lens = camera.intrinsics
        assert lens is not None
        assert lens.camera is not None
        stated = lens.camera.parameters * np.append([1 + share] * 2, np.ones(len(lens.camera.parameters) - 2))
        cameras[name] = replace(
            camera, intrinsics=replace(lens, camera=lens.camera.with_parameters(stated), exact=False)
        )
    return replace(simulated.cell, cameras=cameras)


def _with_bending(rng: np.random.Generator, seed: int) -> Case:
    simulated, sag = simulate(_scenario(target="led", samples=60), seed), rng.uniform(3e-3, 1e-2)

    def change(_: int, state: RobotState) -> RobotState:
        """The pose without the bending."""
        pose = state.base_from_flange
        assert pose is not None
        turn = np.concatenate([np.zeros(3), np.cross(pose.translation, [0, 0, -sag])])
        return RobotState(SE3.exp(turn).inverse() @ pose)

    return simulated, _with_focal_error(simulated, 0.0), _with_poses(simulated, "hand", change)


def _with_wrong_lens(rng: np.random.Generator, seed: int) -> Case:
    simulated = simulate(_scenario(target="led", samples=60), seed)
    return (
        simulated,
        _with_focal_error(simulated, float(rng.choice([-1, 1]) * rng.uniform(0.005, 0.02))),
        simulated.recording,
    )


def _with_short_poses(rng: np.random.Generator, seed: int) -> Case:
    simulated, share = (
        simulate(_scenario(layout="eye_in_hand"), seed),
        float(rng.choice([-1, 1]) * rng.uniform(0.005, 0.02)),
    )

    def change(_: int, state: RobotState) -> RobotState:
        """The pose with a scaled translation."""
        pose = state.base_from_flange
        assert pose is not None
        return RobotState(SE3(pose.rotation, (1 - share) * pose.translation))

    return simulated, simulated.cell, _with_poses(simulated, "arm", change)


def _with_large_board(rng: np.random.Generator, seed: int) -> Case:
    simulated, share = (
        simulate(_scenario(layout="eye_in_hand"), seed),
        float(rng.choice([-1, 1]) * rng.uniform(0.005, 0.02)),
    )
    board = simulated.cell.targets["board"]
    shape = board.target
    assert shape is not None
    options = {key: value * (1 - share) if key.endswith("_m") else value for key, value in shape.options.items()}
    smaller = replace(shape, points=(1 - share) * shape.points, options=options)
    return simulated, replace(simulated.cell, targets={"board": replace(board, target=smaller)}), simulated.recording


def _with_joint_error(rng: np.random.Generator, seed: int, is_gear: bool) -> Case:
    simulated, joint = simulate(_scenario(joints=True), seed), int(rng.integers(1, 5))
    size = float(rng.choice([-1, 1]) * rng.uniform(2e-3, 8e-3))

    def change(_: int, state: RobotState) -> RobotState:
        """Joints with an offset or a gear error."""
        joints = np.array(state.joints_rad)
        joints[joint] -= size * (joints[joint] if is_gear else 1)
        return RobotState(joints_rad=joints)

    return simulated, simulated.cell, _with_poses(simulated, "hand", change)


def _with_moving_base(rng: np.random.Generator, seed: int, is_step: bool) -> Case:
    simulated = simulate(_scenario(), seed)
    size = rng.uniform(5e-4, 3e-3) * rng.standard_normal(6) / np.sqrt(6)
    step_index = int(rng.integers(10, 30))

    def change(k: int, state: RobotState) -> RobotState:
        """The pose in a base that moved."""
        pose = state.base_from_flange
        assert pose is not None
        return RobotState(SE3.exp(size * (k >= step_index if is_step else k / 39)) @ pose)

    return simulated, simulated.cell, _with_poses(simulated, "hand", change)


PAIRS: Mapping[tuple[str, str], tuple[Callable[[np.random.Generator, int], Case], ...]] = {
    ("bending", "focal length"): (_with_bending, _with_wrong_lens),
    ("robot's length", "board's size"): (_with_short_poses, _with_large_board),
    ("joint offset", "gear ratio"): (
        lambda rng, s: _with_joint_error(rng, s, False),
        lambda rng, s: _with_joint_error(rng, s, True),
    ),
    ("step", "drift"): (
        lambda rng, s: _with_moving_base(rng, s, True),
        lambda rng, s: _with_moving_base(rng, s, False),
    ),
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


def measure(seed: int) -> Iterator[dict[str, Any]]:
    """One cell of each pair."""
    for pair, makers in PAIRS.items():
        rng = np.random.default_rng([seed, 31])
        simulated, cell, recording = makers[seed % 2](rng, 5000 + seed)
        calibration = calibrate(cell, recording)
        named = [effect for effect in pair if _is_named(effect, calibration.findings)]
        worst = 0.0
        for name, estimate in calibration.transforms.items():
            error = (estimate.mean.inverse() @ simulated.truth[name]).log()
            worst = max(worst, float(np.abs(error / np.sqrt(np.maximum(np.diag(estimate.covariance), 1e-30))).max()))
        warned = [f.code for f in calibration.findings if f.severity != "info"]
        true = pair[seed % 2]
        yield {
            "pair": pair,
            "true": true,
            "named": named,
            "verdict": calibration.verdict,
            "worst": worst,
            "codes": warned,
        }


def _is_named(effect: str, findings: tuple[Finding, ...]) -> bool:
    warned = [finding.message.lower() for finding in findings if finding.severity != "info"]
    return any(words in message for message in warned for words in WORDS[effect])


def rows(results: list[dict[str, Any]]) -> Iterator[list[object]]:
    """A line for each effect."""
    for pair in PAIRS:
        for true in pair:
            cells = [each for each in results if each["true"] == true]
            counts = [
                sum(each["named"] == [true] for each in cells),
                sum(len(each["named"]) == 2 for each in cells),
                sum(len(each["named"]) == 1 and each["named"] != [true] for each in cells),
                sum(not each["named"] for each in cells),
                sum(each["verdict"] == "good" and each["worst"] > 4 for each in cells),
            ]
            yield [true, len(cells), *counts]


def format_table(results: list[dict[str, Any]]) -> str:
    return table(HEAD, rows(results))


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = """\
Each cell has one of two effects with nearly the same influence on the data. No noise is stated. `named`: a warning
names the true effect and not the other."""
    return f"{about}\n\n{format_table(result['rows'])}"


if __name__ == "__main__":
    run_cells("confounding", sys.argv[1:], CELLS, measure, format_table)
