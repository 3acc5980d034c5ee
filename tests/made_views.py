"""Views as effects see them, made up or simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.systematic_errors.situation import Situation
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import simulate
from tests.ends import end, views


def truth(made, problem):
    """The true state."""
    return State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)), made.robots)


def views_of(scenario, seed=0):
    """Views of a simulated cell about the truth."""
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    return Situation(problem, truth(made, problem), problem, {k: float(k) for k in range(scenario.samples)})


def moved_by_pose(of, robot, pose):
    """Tangents of the view if a robot's recorded poses are others, (n, 6)."""
    change = (of.recorded_pose(0, robot).inverse() @ pose).log()
    return (of.flange_jacobian(0, robot) @ change[..., None])[..., 0]


def _group(sample, camera="wrist", target="board", eye=None, hand="hand", base="base", mount="target"):
    """Views of a target on an arm."""
    at = SE3.identity((len(sample),))
    ends = end(eye, at, mount="camera"), end(hand, at, mount=mount, base=base)
    return replace(views(*ends, camera=camera, target=target), sample=sample)


class Made:
    """Situations of so many samples in a row, whose frames and flanges move views by random matrices."""

    def __init__(self, count, *groups, **changed):
        """Of groups by what differs from a hand's views of a target."""
        rng = np.random.default_rng(0)
        self.groups = [_group(**{"sample": np.arange(count)} | group) for group in groups or ({},)]
        self.estimated_effects, self.chains, self.targets, self.point_mounts = {}, {}, (), frozenset()
        self.samples, self.times, self.has_times = 10 * np.arange(count), np.arange(count, dtype=float), True
        self.robots, self.frames, self.speeds = ("hand",), ("base",), {"hand": rng.standard_normal((count, 6))}
        self.moves = rng.standard_normal((len(self.groups), 2, count, 6, 6))
        vars(self).update(changed)

    def sample_indices(self, group):
        """Where samples stand."""
        return group.sample

    def depends(self, k, name):
        """Whether a group has a frame."""
        return name in self.groups[k].frames

    def target_from_camera(self, k):
        """At k + 1 metres."""
        return SE3(np.eye(3), np.array([0.0, 0.0, k + 1.0]))

    def recorded_pose(self, k, robot):
        """At the base."""
        return SE3.identity((len(self.groups[k].sample),))

    def frame_jacobian(self, k, name):
        """How views go with a frame."""
        return self.moves[k, 0][: len(self.groups[k].sample)]

    def flange_jacobian(self, k, robot):
        """How views go with a flange, the eye's turned round."""
        return (-1 if robot == "eye" else 1) * self.moves[k, 1][: len(self.groups[k].sample)]

    def velocity(self, robot):
        """Of those on a path."""
        return self.speeds.get(robot)
