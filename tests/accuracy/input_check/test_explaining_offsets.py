"""Zeros that are off by degrees are named where robots as stated explain nothing; poses of other samples are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.input_check.explaining_offsets import explaining_offsets
from basecal.accuracy.input_check.unexplained_motion import is_hopeless
from basecal.cell import Recording
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import STATED
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

ARMS = Scenario(samples=16, joints=True, joint_offset_rad=np.radians(8.0))


def test_offsets_of_degrees_are_named():
    """Of each arm the largest that is seen, as it is to a degree or two; the entry has a prior that holds them."""
    made = simulate(ARMS, 1)
    solution = solve(made.cell, made.recording)
    assert is_hopeless(solution.problem, solution.state)
    (found,) = explaining_offsets(solution.problem, solution.state, STATED)
    assert (found.code, found.severity, found.about) == ("robot-model", "error", ("eye", "hand"))
    for robot in ("eye", "hand"):
        true = np.degrees(made.robots[robot].kind_values("joint_offsets"))
        words = found.what.partition(f" of {robot} by ")
        joint = int(words[0].rpartition("joint ")[2]) - 1
        assert 0 < joint < 5
        assert abs(float(words[2].split()[0]) - true[joint]) < 2
    assert "`joint_offsets: {status: prior, sigma_rad: 0." in found.do[0]


def test_offsets_do_not_explain_views_of_other_samples():
    """Whatever is fitted to them; nor is anything said of robots that record poses."""
    for joints in (True, False):
        made = simulate(replace(ARMS, joints=joints, joint_offset_rad=0.0), 0)
        samples = made.recording.samples
        mixed = Recording(tuple(replace(s, observations=samples[-k].observations) for k, s in enumerate(samples)))
        problem, _ = build_problem(made.cell, mixed)
        state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
        assert is_hopeless(problem, state)
        assert explaining_offsets(problem, state, STATED) == []
