"""Views in motion: how targets move before cameras, which is what a stamp's error costs, and when robots pass poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.cell import Cell, Clock
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.streams.rolling_shutter import Known, Moving
from basecal.estimation.streams.streams import Synchronised

_STANDS = 5e-3  # [m/s, rad/s]: as fast as read-backs of an arm that stands seem to be; assumed


def with_jitter(
    problem: Problem, motion: Known, robots: Mapping[str, Mapping[int, Moving]], clocks: Mapping[str, Clock]
) -> Problem:
    """The problem with what is known of the jitter of its cameras' stamps; where none is stated it is to be estimated.

    Args:
        problem: Of samples by one time.
        motion: What it is seen with, as far as known: errors of it count as little as a target moves in the jitter.
        robots: Where each robot was, and how fast, by name and sample.
        clocks: What is known of each device's clock.
    """
    stated = {camera: clocks[camera].jitter_s for camera in {g.camera for g in problem.groups}}
    sigmas = {camera: sigma for camera, sigma in stated.items() if sigma is not None}
    moving = problem.with_groups(_with_motion(group, motion, robots) for group in problem.groups)
    open_clocks = frozenset(name for name, clock in clocks.items() if clock.status != "fixed")
    return replace(
        moving, jitter_s=sigmas, open_jitter=frozenset(stated.keys() - sigmas.keys()), open_clocks=open_clocks
    )


def _with_motion(group: ViewGroup, known_motion: Known, robots: Mapping[str, Mapping[int, Moving]]) -> ViewGroup:
    motion = np.zeros((len(group), 6))
    for view, sample in enumerate(group.sample.tolist()):
        here = {name: of[sample] for name, of in robots.items() if sample in of}
        placed = known_motion.camera_from_target(group.camera, group.target, here)
        if placed is not None:
            motion[view] = placed[1]
    return replace(group, motion=motion)


def with_passing_times(problem: Problem, samples: Synchronised, cell: Cell) -> Problem:
    """The problem of samples by one time, whose ends know when their robots moved.

    A stated repeatability is of stops: the noise of an arm that moves is open.
    """
    stamps = {s.sample: s.stamp_s for s in samples.recording.samples if s.stamp_s is not None}
    times = {
        robot: {number: stamps[number] for number, at in views.items() if np.abs(at.velocity).max() > _STANDS}
        for robot, views in samples.robots.items()
    }

    def add_times(group: ViewGroup, end: End) -> End:
        """An end of the views of a group."""
        if end.robot is None:
            return end
        mine = times.get(end.robot, {})
        return replace(end, passed_s=np.array([mine.get(number, np.nan) for number in group.sample.tolist()]))

    moving = {robot for robot, passed in times.items() if passed and not cell.robots[robot].is_total_noise}
    timed = problem.with_groups(
        replace(group, ends=(add_times(group, group.eye), add_times(group, group.hand))) for group in problem.groups
    )
    return replace(timed, unstated=timed.unstated | (moving & set(timed.stops.robot)))
