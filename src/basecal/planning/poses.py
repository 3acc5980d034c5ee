"""Poses all around: both arms turn about the target, which stays in view, as far as they reach."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.errors import InputError
from basecal.planning.candidates import POSE_REACH, draw_feasible
from basecal.planning.feasible import blocked_samples, is_path_clear
from basecal.planning.sketch import Sketch

_DRAWS, _DRAW_ROUNDS = 2, 100  # at once for each sample, and how often: near limits one in ten is feasible


def plan(sketch: Sketch, home: Mapping[str, RobotState], samples: int, seed: int = 0) -> list[Sample]:
    """Samples with both arms at new places each, in an order that makes their way short.

    Args:
        sketch: What is known of the cell.
        home: Where the robots are, with the target in view.
        samples: How many.
        seed: Of the draws.

    Raises:
        InputError: if hardly any is feasible.
    """
    rng = np.random.default_rng([seed, 17])
    found: list[Sample] = []
    for _ in range(_DRAW_ROUNDS):
        found += draw_feasible(sketch, [home], _DRAWS * samples, dict.fromkeys(sketch.movers, POSE_REACH), rng)
        if len(found) >= samples:
            ordered = order_samples(sketch, home, found[:samples])
            unclear = blocked_samples(sketch, home, ordered)
            if not unclear:
                return ordered
            found = [*(sample for sample in ordered if sample.sample not in unclear), *found[samples:]]
    raise InputError(
        f"only {len(found)} of {samples} poses are within the arms' limits, in view and clear. Begin with the target "
        "sharp, in the middle of the image, and the arms far from their limits"
    )


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
