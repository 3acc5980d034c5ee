"""Candidate samples: both arms moved about the target from taught poses, with the target in view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.errors import InputError
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.rotation import rotation_exp
from basecal.planning.feasible import approach_poses, is_clear, is_in_view, visibility_mask, with_seen_distances
from basecal.planning.sketch import Sketch

RobotStates = Mapping[str, RobotState]

Reach = tuple[float, float]
"""Largest rotation of an arm about the target [rad], and its largest translation [m]."""
POSE_REACH: Reach = (0.6, 0.12)
"""Reach about a taught pose if limits are unknown: mostly feasible; two arms give views up to 50 degrees apart."""
_JOINT_REACH: Reach = (1.0, 0.25)  # of an arm whose limits are known
_DRAW_ROUNDS = 20  # largest number of rounds of draws


def candidates(sketch: Sketch, taught_states: Sequence[RobotStates], count: int, seed: int = 0) -> list[Sample]:
    """Draw at most `count` feasible samples; none is at a taught pose, which would repeat a recorded stop.

    Args:
        sketch: Sketch of the cell.
        taught_states: States of all robots at which the target was seen.
        count: Largest number of samples.
        seed: Seed of the random draws.

    Raises:
        InputError: if no drawn sample is feasible.
    """
    rng = np.random.default_rng([seed, 29])
    robots = sketch.cell.robots
    reach = {name: POSE_REACH if robots[name].chain is None else _JOINT_REACH for name in sketch.movers}
    found: list[Sample] = []
    for _ in range(_DRAW_ROUNDS):
        if len(found) >= count:
            break
        found += draw_feasible(sketch, taught_states, count, reach, rng)
    if not found:
        raise InputError(
            "no sample near the taught poses is within the arms' limits, with the whole target in view and clear. "
            "Teach poses with the target sharp, in the middle of the image, and the arms far from their limits"
        )
    return [Sample(k, robots=sample.robots) for k, sample in enumerate(found[:count])]


def draw_feasible(
    sketch: Sketch,
    taught_states: Sequence[RobotStates],
    count: int,
    reach: Mapping[str, Reach],
    rng: np.random.Generator,
) -> list[Sample]:
    """Draw samples, and return the feasible ones.

    Args:
        sketch: Sketch of the cell.
        taught_states: States of all robots at which the target was seen.
        count: Number of draws.
        reach: Reach of each robot that moves, by name.
        rng: Random number generator.
    """
    sketch = with_seen_distances(sketch, taught_states)
    neighbours = rng.integers(len(taught_states), size=count)
    pivots = np.array(
        [sketch.body_pose(sketch.target.name, states) @ sketch.target_points.mean(0) for states in taught_states]
    )[neighbours]
    drawn = {}
    for robot, (most_rad, most_m) in reach.items():
        rotation = rotation_exp(most_rad * draw_in_ball(rng, count))
        translation = pivots + most_m * draw_in_ball(rng, count) - (rotation @ pivots[..., None])[..., 0]
        world_from_base = sketch.world_from_base(robot)
        poses = SE3.stack([sketch.base_from_flange(robot, states[robot]) for states in taught_states])
        drawn[robot] = world_from_base.inverse() @ SE3(rotation, translation) @ world_from_base @ poses[neighbours]
    return _feasible(sketch, taught_states, neighbours, drawn)


def draw_in_ball(rng: np.random.Generator, *count: int) -> Array:
    """Draw points uniformly in the unit ball, (*count, 3)."""
    direction = rng.standard_normal((*count, 3))
    return np.asarray(np.cbrt(rng.random((*count, 1))) * direction / np.linalg.norm(direction, axis=-1, keepdims=True))


def _feasible(
    sketch: Sketch, taught_states: Sequence[RobotStates], neighbours: IntArray, flanges: Mapping[str, SE3]
) -> list[Sample]:
    """Feasible samples among drawn poses of flanges in their bases, (n,) by robot."""
    drawn = Sample(0, robots={robot: RobotState(poses) for robot, poses in flanges.items()})
    rows = np.flatnonzero(visibility_mask(sketch, sketch.camera_from_target(drawn)))
    states: dict[str, list[RobotState | None]] = {}
    for robot, poses in flanges.items():
        starts = [taught_states[k][robot] for k in neighbours[rows]]
        states[robot] = approach_poses(sketch.cell.robots[robot], poses[rows], starts)
    samples = []
    for row, new_states in enumerate(zip(*states.values(), strict=True)):
        reached = {robot: state for robot, state in zip(states, new_states, strict=True) if state is not None}
        if len(reached) < len(states):
            continue
        sample = Sample(0, robots={**taught_states[neighbours[rows[row]]], **reached})
        if is_in_view(sketch, sample) and is_clear(sketch, sample):
            samples.append(sample)
    return samples
