"""Recordings of robots that move in a way of one's choosing: about one axis, without turning, by a few joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from basecal.cell import Recording, RobotState, Sample
from basecal.geometry import SE3
from basecal.geometry.rotation import rotation_exp
from basecal.kinematics import SerialChain
from basecal.simulation import Scenario, SimulatedCell, draw
from basecal.simulation.layout import make_layout
from basecal.simulation.motion import Motion, seen_points
from basecal.simulation.scene import draw_scene
from basecal.simulation.stated_cell import stated_cell, truth
from basecal.simulation.testbed import observe

# From a home pose, where the target is in the robot's base, and a generator: poses of the flange.
Move = Callable[[SE3, np.ndarray, int, np.random.Generator], SE3]

TRIES = 1200
AXIS = np.array([0.48, -0.6, 0.64])


def turned(spread, shift, axes=None, across=None) -> Move:
    """Turns about the target by up to `spread` rad about `axes`, and shifts by up to `shift` m, none along `across`."""

    def move(home: SE3, pivot: np.ndarray, n: int, rng: np.random.Generator) -> SE3:
        ball = draw.draw_in_ball(rng, n, spread)
        vectors = ball if axes is None else ball[:, : len(axes)] @ np.atleast_2d(axes)
        shifts = draw.draw_in_ball(rng, n, shift) if shift else np.zeros((n, 3))
        if across is not None:
            shifts -= np.outer(shifts @ across, across)
        turn = rotation_exp(vectors)
        return SE3(turn, pivot + shifts - turn @ pivot) @ home

    return move


def still(home: SE3, pivot: np.ndarray, n: int, rng: np.random.Generator) -> SE3:
    """In one place."""
    return SE3(np.repeat(home.rotation[None], n, 0), np.repeat(home.translation[None], n, 0))


def wobbling(move: Move, rad: float, metres: float = 0.0) -> Move:
    """The same with small true turns and shifts, which are recorded."""

    def moved(home: SE3, pivot: np.ndarray, n: int, rng: np.random.Generator) -> SE3:
        return move(home, pivot, n, rng) @ SE3.exp(draw.tangents(rng, n, (metres, rad)))

    return moved


def by_joints(chain: SerialChain, middle: np.ndarray, spread: float) -> Move:
    """An arm near a middle position of its joints; see `recorded`, which places its base."""

    def move(home: SE3, pivot: np.ndarray, n: int, rng: np.random.Generator) -> SE3:
        return chain.forward(middle + rng.uniform(-spread, spread, (n, chain.n)))

    return move


GENERAL = turned(0.6, 0.12)
SHIFTS = turned(0.0, 0.12)
ONE_AXIS = turned(0.9, 0.0, [AXIS])
PLANAR = turned(0.9, 0.12, [AXIS], AXIS)
SCARA = turned(0.9, 0.12, [AXIS])


def recorded(
    scenario: Scenario,
    seed: int,
    eye: Move = GENERAL,
    hand: Move = GENERAL,
    hand_home: SE3 | None = None,
) -> SimulatedCell:
    """A dual cell in which eye and hand move so; with `hand_home`, the hand's base is placed where this is its home."""
    for_scene, for_motion, for_noise, for_priors = np.random.default_rng(seed).spawn(4)
    scene = draw_scene(scenario, make_layout("dual"), for_scene)
    if hand_home is not None:
        world_from_flange = scene.bases["hand"] @ scene.homes[0]["hand"]
        bases = {**scene.bases, "hand": world_from_flange @ hand_home.inverse()}
        scene = replace(scene, bases=bases, homes=({**scene.homes[0], "hand": hand_home},))
    pivot = scene.body_pose("board", scene.homes[0]) @ scene.shapes["board"].points.mean(0)
    tried = {
        robot: move(scene.homes[0][robot], scene.bases[robot].inverse() @ pivot, TRIES, for_motion)
        for robot, move in (("eye", eye), ("hand", hand))
    }
    offsets = {robot: SE3.exp(draw.tangents(for_motion, TRIES, scenario.robot_noise)) for robot in tried}
    true = {robot: poses @ offsets[robot] for robot, poses in tried.items()}
    kept = np.flatnonzero(seen_points(scene, scenario, ("wrist", "board"), true).all(-1))[: scenario.samples]
    assert len(kept) == scenario.samples
    motion = Motion(0, {r: p[kept] for r, p in tried.items()}, {r: p[kept] for r, p in true.items()})
    samples = tuple(
        Sample(k, float(k), {robot: RobotState(poses[k]) for robot, poses in motion.recorded.items()}, observations)
        for k, observations in enumerate(observe(motion, scene, scenario, for_noise))
    )
    cell = stated_cell(scene, scenario, for_priors, {})
    return SimulatedCell(cell, Recording(samples), truth(scene, cell), scene.lenses, motion.true)


def arm(*axes: str) -> SerialChain:
    """An arm whose joints turn about these axes (x, y or z) with links of 0.3 m along x and 0.1 m along z."""
    n = len(axes)
    link = SE3(np.eye(3), np.array([0.3, 0.0, 0.1]))
    return SerialChain(
        tuple(f"j{k}" for k in range(n)),
        SE3.stack([SE3.identity(), *[link] * (n - 1)]),
        np.stack([np.eye(3)["xyz".index(axis)] for axis in axes]),
        link,
        np.full(n, -np.pi),
        np.full(n, np.pi),
    )


def recorded_arm(scenario: Scenario, seed: int, axes: str, spread: float = 0.6) -> SimulatedCell:
    """The hand is an arm of these joints, each within `spread` rad of a middle position; the eye moves freely."""
    chain = arm(*axes)
    middle = np.linspace(0.3, 0.7, chain.n)
    made = recorded(scenario, seed, hand=by_joints(chain, middle, spread), hand_home=chain.forward(middle))
    hand = replace(made.cell.robots["hand"], chain=chain)
    return replace(made, cell=replace(made.cell, robots={**made.cell.robots, "hand": hand}))
