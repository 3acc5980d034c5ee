"""Views as effects use them, random or simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.systematic_errors.situation import Situation
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import simulate
from tests.ends import end, views


def truth(simulated, problem):
    """The true state of a simulated cell."""
    return State(simulated.truth, simulated.cameras, np.zeros((len(problem.stops), 6)), simulated.robots)


def views_of(scenario, seed=0):
    """Views of a simulated cell at the true state."""
    simulated = simulate(scenario, seed)
    problem, _ = build_problem(simulated.cell, simulated.recording)
    return Situation(problem, truth(simulated, problem), problem, {k: float(k) for k in range(scenario.samples)})


def moved_by_pose(situation, robot, pose):
    """Tangents (n, 6) of the first group's views after replacing a robot's recorded poses by `pose`."""
    change = (situation.recorded_pose(0, robot).inverse() @ pose).log()
    return (situation.flange_jacobian(0, robot) @ change[..., None])[..., 0]


def _group(sample, camera="wrist", target="board", eye=None, hand="hand", base="base", mount="target"):
    """Views of a target on an arm, all poses at the identity."""
    poses = SE3.identity((len(sample),))
    ends = end(eye, poses, mount="camera"), end(hand, poses, mount=mount, base=base)
    return replace(views(*ends, camera=camera, target=target), sample=sample)


class Made:
    """A stand-in for a Situation: `count` samples in a row, and random matrices for effects of frames and flanges."""

    def __init__(self, count, *groups, **changes):
        """Make each group from its differences to a hand's views of a target."""
        rng = np.random.default_rng(0)
        self.groups = [_group(**{"sample": np.arange(count)} | group) for group in groups or ({},)]
        self.estimated_effects, self.chains, self.targets, self.point_mounts = {}, {}, (), frozenset()
        self.samples, self.times, self.has_times = 10 * np.arange(count), np.arange(count, dtype=float), True
        self.robots, self.frames, self.speeds = ("hand",), ("base",), {"hand": rng.standard_normal((count, 6))}
        self.moves = rng.standard_normal((len(self.groups), 2, count, 6, 6))
        vars(self).update(changes)

    def sample_indices(self, group):
        """Ranks of the samples of a group."""
        return group.sample

    def depends(self, k, name):
        """Return whether a group has a frame."""
        return name in self.groups[k].frames

    def target_from_camera(self, k):
        """Poses of the target at k + 1 metres."""
        return SE3(np.eye(3), np.array([0.0, 0.0, k + 1.0]))

    def recorded_pose(self, k, robot):
        """Recorded poses, all at the identity."""
        return SE3.identity((len(self.groups[k].sample),))

    def frame_jacobian(self, k, name):
        """Derivatives of views to a frame."""
        return self.moves[k, 0][: len(self.groups[k].sample)]

    def flange_jacobian(self, k, robot):
        """Derivatives of views to a flange; the eye's have the other sign."""
        return (-1 if robot == "eye" else 1) * self.moves[k, 1][: len(self.groups[k].sample)]

    def velocity(self, robot):
        """Velocities of a robot; None if it has none."""
        return self.speeds.get(robot)
