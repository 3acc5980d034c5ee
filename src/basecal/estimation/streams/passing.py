"""When robots that do not stand still pass the poses of views: errors of one path are near one another in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Cell
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.streams.streams import Synchronised

_STANDS = 5e-3  # [m/s, rad/s]: as fast as read-backs of an arm that stands seem to be; assumed


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
