"""`far-task`: the task is far from the recorded poses of robots without recorded joints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding
from basecal.effects.smooth import LENGTH_M
from basecal.geometry import Array


def far_task(evidence: Evidence) -> list[Finding]:
    """An info if no robot without recorded joints was recorded near the task."""
    if evidence.settings.task_point is None:
        return []
    far = dict(_distances(evidence, np.array(evidence.settings.task_point)))
    nearest_m = min(far.values(), default=0.0)
    if nearest_m < LENGTH_M / 2:
        return []
    what = f"The task point is {nearest_m:.2g} m from the nearest recorded flange of {' and '.join(far)}."
    why = "The error there includes the uncalibrated kinematic errors of the arms."
    return [Finding("far-task", "info", tuple(far), what, ("Record samples where the arms will work.",), why)]


def _distances(evidence: Evidence, point_m: Array) -> Iterator[tuple[str, float]]:
    """Distance of a point from the nearest recorded flange of each robot without recorded joints [m]."""
    problem, transforms = evidence.solution.problem, evidence.solution.state.transforms
    for robot in problem.robots:
        ends = problem.robot_ends(robot)
        if any(end.joints is not None for end in ends):
            continue
        base = ends[0].world_from_base(transforms)
        places = np.concatenate([base @ end.base_from_flange.translation for end in ends])
        yield robot, float(np.linalg.norm(places - point_m, axis=1).min())
