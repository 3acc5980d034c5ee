"""Views in motion: velocities of targets relative to cameras, and the times at which moving robots pass poses.

The velocity determines the effect of an error of a time stamp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.cell import Cell, Clock
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.streams.rolling_shutter import KnownGeometry, RobotMotion
from basecal.estimation.streams.streams import Synchronised

_REST_VELOCITY = 5e-3  # [m/s, rad/s] apparent velocity of an arm at rest, from noise of its recorded poses; assumed


def with_jitter(
    problem: Problem,
    geometry: KnownGeometry,
    robots: Mapping[str, Mapping[int, RobotMotion]],
    clocks: Mapping[str, Clock],
) -> Problem:
    """Return a problem with the motion of its views and the timing jitter of its cameras.

    Unstated jitter is to be estimated.

    Args:
        problem: Problem of synchronised samples.
        geometry: Known transforms, from which velocities follow. Their errors have little effect, since the motion
            during the jitter is small.
        robots: Pose and velocity of each robot, by name and sample.
        clocks: Stated clock of each device.
    """
    stated = {camera: clocks[camera].jitter_s for camera in {g.camera for g in problem.groups}}
    sigmas = {camera: sigma for camera, sigma in stated.items() if sigma is not None}
    with_motion = problem.with_groups(_with_motion(group, geometry, robots) for group in problem.groups)
    open_clocks = frozenset(name for name, clock in clocks.items() if clock.status != "fixed")
    return replace(
        with_motion, jitter_s=sigmas, open_jitter=frozenset(stated.keys() - sigmas.keys()), open_clocks=open_clocks
    )


def _with_motion(
    group: ViewGroup, geometry: KnownGeometry, robots: Mapping[str, Mapping[int, RobotMotion]]
) -> ViewGroup:
    motion = np.zeros((len(group), 6))
    for view, sample in enumerate(group.sample.tolist()):
        motions = {name: by_sample[sample] for name, by_sample in robots.items() if sample in by_sample}
        pose_and_velocity = geometry.camera_from_target(group.camera, group.target, motions)
        if pose_and_velocity is not None:
            motion[view] = pose_and_velocity[1]
    return replace(group, motion=motion)


def with_passing_times(problem: Problem, samples: Synchronised, cell: Cell) -> Problem:
    """Return a problem of synchronised samples, with the times of views during motion in its ends.

    A stated repeatability holds for stops. The noise of a moving arm therefore counts as unstated.
    """
    stamps = samples.recording.stamps
    times = {
        robot: {
            number: stamps[number] for number, motion in views.items() if np.abs(motion.velocity).max() > _REST_VELOCITY
        }
        for robot, views in samples.robots.items()
    }

    def add_times(group: ViewGroup, end: End) -> End:
        """Add the times of views during motion to an end of a group."""
        if end.robot is None:
            return end
        passed = times.get(end.robot, {})
        return replace(end, passed_s=np.array([passed.get(number, np.nan) for number in group.sample.tolist()]))

    moving = {robot for robot, passed in times.items() if passed and not cell.robots[robot].is_total_noise}
    timed = problem.with_groups(
        replace(group, ends=(add_times(group, group.eye), add_times(group, group.hand))) for group in problem.groups
    )
    return replace(timed, unstated=timed.unstated | (moving & set(timed.stops.robot)))
