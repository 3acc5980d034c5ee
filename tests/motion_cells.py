"""Recordings of robots with a chosen kind of motion: about one axis, without rotation, or by a few joints."""

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

# Poses of the flange from a home pose, the position of the target in the base, a count and a generator.
Move = Callable[[SE3, np.ndarray, int, np.random.Generator], SE3]

TRIES = 1200
AXIS = np.array([0.48, -0.6, 0.64])


def turned(spread, shift, axes=None, across=None) -> Move:
    """Rotations about the target by up to `spread` rad about `axes`; shifts by up to `shift` m normal to `across`."""

    def move(home: SE3, pivot: np.ndarray, n: int, rng: np.random.Generator) -> SE3:
        drawn = draw.draw_in_ball(rng, n, spread)
        rotation_vectors = drawn if axes is None else drawn[:, : len(axes)] @ np.atleast_2d(axes)
        shifts = draw.draw_in_ball(rng, n, shift) if shift else np.zeros((n, 3))
        if across is not None:
            shifts -= np.outer(shifts @ across, across)
        rotations = rotation_exp(rotation_vectors)
        return SE3(rotations, pivot + shifts - rotations @ pivot) @ home

    return move


def still(home: SE3, pivot: np.ndarray, n: int, rng: np.random.Generator) -> SE3:
    """No motion."""
    return SE3(np.repeat(home.rotation[None], n, 0), np.repeat(home.translation[None], n, 0))


def wobbling(move: Move, rad: float, metres: float = 0.0) -> Move:
    """A motion with small random rotations and shifts added, which are recorded."""

    def moved(home: SE3, pivot: np.ndarray, n: int, rng: np.random.Generator) -> SE3:
        return move(home, pivot, n, rng) @ SE3.exp(draw.tangents(rng, n, (metres, rad)))

    return moved


def by_joints(chain: SerialChain, middle: np.ndarray, spread: float) -> Move:
    """An arm near a middle position of its joints; `recorded` places its base."""

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
    """Simulate a dual cell with these motions; `hand_home` places the hand's base so that it is the home pose."""
    for_scene, for_motion, for_noise, for_priors = np.random.default_rng(seed).spawn(4)
    scene = draw_scene(scenario, make_layout("dual"), for_scene)
    if hand_home is not None:
        world_from_flange = scene.bases["hand"] @ scene.homes[0]["hand"]
        bases = {**scene.bases, "hand": world_from_flange @ hand_home.inverse()}
        scene = replace(scene, bases=bases, homes=({**scene.homes[0], "hand": hand_home},))
    pivot = scene.body_pose("board", scene.homes[0]) @ scene.shapes["board"].points.mean(0)
    candidates = {
        robot: move(scene.homes[0][robot], scene.bases[robot].inverse() @ pivot, TRIES, for_motion)
        for robot, move in (("eye", eye), ("hand", hand))
    }
    offsets = {robot: SE3.exp(draw.tangents(for_motion, TRIES, scenario.robot_noise)) for robot in candidates}
    true = {robot: poses @ offsets[robot] for robot, poses in candidates.items()}
    kept = np.flatnonzero(seen_points(scene, scenario, ("wrist", "board"), true).all(-1))[: scenario.samples]
    assert len(kept) == scenario.samples
    motion = Motion(0, {r: p[kept] for r, p in candidates.items()}, {r: p[kept] for r, p in true.items()})
    samples = tuple(
        Sample(k, float(k), {robot: RobotState(poses[k]) for robot, poses in motion.recorded.items()}, observations)
        for k, observations in enumerate(observe(motion, scene, scenario, for_noise))
    )
    cell = stated_cell(scene, scenario, for_priors, {})
    return SimulatedCell(cell, Recording(samples), truth(scene, cell), scene.lenses, motion.true)


def arm(*axes: str) -> SerialChain:
    """An arm whose joints turn about these axes (x, y or z), with links of 0.3 m along x and 0.1 m along z."""
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
    """A cell whose hand is an arm with joints within `spread` rad of a middle position; the eye moves freely."""
    chain = arm(*axes)
    middle = np.linspace(0.3, 0.7, chain.n)
    simulated = recorded(scenario, seed, hand=by_joints(chain, middle, spread), hand_home=chain.forward(middle))
    hand = replace(simulated.cell.robots["hand"], chain=chain)
    return replace(simulated, cell=replace(simulated.cell, robots={**simulated.cell.robots, "hand": hand}))
