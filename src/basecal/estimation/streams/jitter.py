"""Views whose stamps jitter: how targets move before the cameras at each, which is what a stamp's error costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.cell import Clock
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.streams.rolling_shutter import Known, Moving


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
