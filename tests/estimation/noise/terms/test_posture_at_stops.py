"""How an arm stood at its stops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.noise.robot_noise import stands
from basecal.estimation.noise.terms.posture_at_stops import is_estimated, posture_at_stops
from basecal.simulation import Scenario
from simulated_problem import simulated_problem

SCENARIO = Scenario(samples=8, joints=True)


def test_the_chain_stands_where_the_stops_are():
    """At each stop that was seen; at others at the mean of the joints."""
    problem = simulated_problem(SCENARIO)
    poses, _ = stands(problem, "hand")
    at = posture_at_stops(problem, "hand")
    np.testing.assert_allclose(at.chain.forward(at.recorded).matrix, poses.matrix, atol=1e-12)
    (group,) = problem.groups
    some = problem.with_groups([group.take(np.arange(1, len(group)))])
    unseen = posture_at_stops(some, "hand").recorded[group.hand_stand[0]]
    np.testing.assert_allclose(unseen, np.delete(at.recorded, group.hand_stand[0], axis=0).mean(0))


def test_arms_that_record_poses_and_few_stops_have_none():
    """There is nothing to tell of their joints."""
    assert posture_at_stops(simulated_problem(replace(SCENARIO, joints=False)), "hand") is None
    assert posture_at_stops(simulated_problem(replace(SCENARIO, samples=3)), "hand") is None


def test_what_is_estimated_is_told():
    """By kind."""
    problem = simulated_problem(replace(SCENARIO, joint_offset_rad=1e-3, joint_offsets="prior"))
    assert is_estimated(problem, "hand", "link_parameters", "joint_offsets")
    assert not is_estimated(problem, "hand", "link_parameters")
    assert not is_estimated(simulated_problem(SCENARIO), "hand", "joint_offsets")
