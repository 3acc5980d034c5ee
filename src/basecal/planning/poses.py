"""Poses all around: both arms turn about the target, which stays in view, as far as they reach."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import rotation_exp
from basecal.planning.feasible import Feasible, blocked_samples, is_path_clear, reach_pose
from basecal.planning.pattern import Pattern
from basecal.planning.sketch import Sketch

_TURN_RAD = 0.6  # of each arm about the target at most: with both, views of a board up to 50 degrees apart
_SHIFT_M = 0.12  # of each arm besides
_SAMPLE_TRIES = 200  # for each sample: of these one in ten is feasible with arms near their limits


def plan(
    sketch: Sketch, home: Mapping[str, RobotState], feasible: Feasible, samples: int, seed: int = 0
) -> list[Sample]:
    """Samples with both arms at new places each, in an order that makes their way short.

    Args:
        sketch: What is known of the cell.
        home: Where the robots are, with the target in view.
        feasible: Whether a sample can be taken.
        samples: How many.
        seed: Of the draws.

    Raises:
        InputError: if hardly any is feasible.
    """
    rng = np.random.default_rng([seed, 17])
    found: list[Sample] = []
    for _ in range(_SAMPLE_TRIES * samples):
        sample = _draw_sample(sketch, home, rng)
        if sample is not None and feasible(sample):
            found.append(sample)
        if len(found) == samples:
            ordered = order_samples(sketch, home, found)
            unclear = blocked_samples(sketch, home, ordered)
            if not unclear:
                return ordered
            found = [sample for sample in ordered if sample.sample not in unclear]
    raise InputError(
        f"only {len(found)} of {samples} poses are within the arms' limits, in view and clear. Begin with the target "
        "in the image's middle, 0.5 to 1 m away, and the arms far from their limits"
    )


def _draw_sample(sketch: Sketch, home: Mapping[str, RobotState], rng: np.random.Generator) -> Sample | None:
    pivot: Array = sketch.body_pose(sketch.target.name, home) @ sketch.target_points.mean(0)
    states = dict(home)
    for robot in sketch.movers:
        turn, shift = rotation_exp(_TURN_RAD * draw_in_ball(rng)), _SHIFT_M * draw_in_ball(rng)
        world_from_base = sketch.world_from_base(robot)
        world_from_flange = world_from_base @ sketch.base_from_flange(robot, home[robot])
        moved = SE3(turn, pivot + shift - turn @ pivot) @ world_from_flange
        state = reach_pose(sketch.cell.robots[robot], world_from_base.inverse() @ moved, home[robot])
        if state is None:
            return None
        states[robot] = state
    return Sample(0, robots=states)


def draw_in_ball(rng: np.random.Generator, *count: int) -> Array:
    """Uniform in the unit ball, (*count, 3)."""
    direction = rng.standard_normal((*count, 3))
    return np.asarray(np.cbrt(rng.random((*count, 1))) * direction / np.linalg.norm(direction, axis=-1, keepdims=True))


def order_samples(sketch: Sketch, home: Mapping[str, RobotState], samples: list[Sample]) -> list[Sample]:
    """Samples so that each is followed by the nearest of those left to which the way is clear, numbered from 0.

    Where it is clear to none of them, by the nearest.
    """
    left, at, ordered = list(samples), Sample(0, robots=dict(home)), list[Sample]()
    while left:
        by_way = sorted(range(len(left)), key=lambda k: _path_length(sketch, at, left[k]))
        at = left.pop(next((k for k in by_way if is_path_clear(sketch, at, left[k])), by_way[0]))
        ordered.append(Sample(len(ordered), robots=at.robots))
    return ordered


def _path_length(sketch: Sketch, start: Sample, end: Sample) -> float:
    """How far the arms go: the largest joint angle [rad], or of poses the distance [m] and the turn [rad]."""
    ways = []
    for robot in end.robots.keys() & start.robots.keys():
        one, other = start.robots[robot], end.robots[robot]
        if one.joints_rad is not None and other.joints_rad is not None:
            ways.append(float(np.abs(one.joints_rad - other.joints_rad).max()))
        else:
            between = sketch.base_from_flange(robot, one).inverse() @ sketch.base_from_flange(robot, other)
            ways.append(float(np.abs(between.log()).max()))
    return max(ways, default=0.0)


PATTERN = Pattern(plan)
