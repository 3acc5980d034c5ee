"""`identical-robots`: two robots with identical recorded poses."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from basecal.accuracy.findings.evidence import Input
from basecal.cell import Finding
from basecal.geometry import Array

_FEWEST_POSES = 3  # distinct poses that two robots do not share by chance; more than a home pose and one more; assumed


def identical_robots(inputs: Input) -> list[Finding]:
    """An error about each pair of moving robots with identical poses, such as from one file for both."""
    poses = {robot: _recorded_poses(inputs, robot) for robot in inputs.problem.robots}
    return [
        Finding(
            "identical-robots",
            "error",
            (first, second),
            f"{first} and {second} have identical poses.",
            (f"Import the poses of {first} or {second} again from its own file, with --replace.",),
            "One file was probably imported for both.",
        )
        for first, second in combinations(poses, 2)
        if len(poses[first]) >= _FEWEST_POSES and np.array_equal(poses[first], poses[second])
    ]


def _recorded_poses(inputs: Input, robot: str) -> Array:
    """Poses of a robot in the order of samples, (n, 16); empty for joints or fewer than three distinct poses."""
    rows: dict[int, Array] = {}
    for group in inputs.problem.groups:
        end = group.robot_end(robot)
        if end is not None and end.joints is None:
            rows |= dict(zip(group.sample.tolist(), end.base_from_flange.matrix.reshape(-1, 16), strict=True))
    ordered = [rows[number] for number in sorted(rows)]
    return np.array(ordered) if len({each.tobytes() for each in ordered}) >= _FEWEST_POSES else np.zeros((0, 16))
