"""Pattern of poses: both arms rotate about the target within their reach, with the target in view."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.errors import InputError
from basecal.planning.candidates import POSE_REACH, draw_feasible
from basecal.planning.feasible import blocked_samples, is_path_clear
from basecal.planning.sketch import Sketch

_DRAWS, _DRAW_ROUNDS = 2, 100  # draws per sample in a round, and rounds: near joint limits one in ten is feasible


def plan(sketch: Sketch, home: Mapping[str, RobotState], samples: int, seed: int = 0) -> list[Sample]:
    """Plan samples with new poses of both arms, ordered for a short path.

    Args:
        sketch: Sketch of the cell.
        home: States of the robots, with the target in view.
        samples: Number of samples.
        seed: Seed of the random draws.

    Raises:
        InputError: if too few samples are feasible.
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
    """Order samples, numbered from 0: each is followed by the nearest remaining sample with a collision-free path.

    If no path is collision-free, the nearest remaining sample follows.
    """
    remaining, current, ordered = list(samples), Sample(0, robots=dict(home)), list[Sample]()
    while remaining:
        by_length = sorted(range(len(remaining)), key=lambda k: _path_length(sketch, current, remaining[k]))
        current = remaining.pop(
            next((k for k in by_length if is_path_clear(sketch, current, remaining[k])), by_length[0])
        )
        ordered.append(Sample(len(ordered), robots=current.robots))
    return ordered


def _path_length(sketch: Sketch, start: Sample, end: Sample) -> float:
    """Largest change of any joint [rad]; for robots with poses, of the pose's translation [m] and rotation [rad]."""
    lengths = []
    for robot in end.robots.keys() & start.robots.keys():
        first, second = start.robots[robot], end.robots[robot]
        if first.joints_rad is not None and second.joints_rad is not None:
            lengths.append(float(np.abs(first.joints_rad - second.joints_rad).max()))
        else:
            motion = sketch.base_from_flange(robot, first).inverse() @ sketch.base_from_flange(robot, second)
            lengths.append(float(np.abs(motion.log()).max()))
    return max(lengths, default=0.0)
