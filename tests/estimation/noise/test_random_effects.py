"""Errors that the stops of a problem share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.random_effects import posture_at_stops, shared_errors
from basecal.estimation.noise.robot_noise import stands
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
    unseen = posture_at_stops(some, "hand").recorded[group.hand.stand[0]]
    np.testing.assert_allclose(unseen, np.delete(at.recorded, group.hand.stand[0], axis=0).mean(0))


def test_arms_that_record_poses_and_few_stops_have_none():
    """There is nothing to tell of their joints."""
    assert posture_at_stops(simulated_problem(replace(SCENARIO, joints=False)), "hand") is None
    assert posture_at_stops(simulated_problem(replace(SCENARIO, samples=3)), "hand") is None


def records(name):
    """Whether the arm with an effect records joints: one that records poses alone may have more effects."""
    return replace(SCENARIO, joints=not RANDOM_EFFECTS[name].is_of_poses_alone)


def test_arms_that_record_joints_have_errors_of_joints_and_links_instead():
    """None by their reach."""
    assert shared_errors(RANDOM_EFFECTS["smooth_by_reach"], simulated_problem(SCENARIO), "hand") is None


@pytest.mark.parametrize("name", RANDOM_EFFECTS)
def test_errors_are_of_the_stops(name):
    """Six rows for each stop of a robot, a column for each error; a unit of all turns the flange by a unit or a few."""
    problem = simulated_problem(replace(records(name), samples=12))
    errors = shared_errors(RANDOM_EFFECTS[name], problem, "hand")
    assert errors.by_stop.shape == (len(stands(problem, "hand")[0]), 6, len(errors.is_turn))
    turned = errors.flange_sigmas(np.ones(2))[3:]
    assert np.all((turned > 0.1) & (turned < 4))


@pytest.mark.parametrize("name", RANDOM_EFFECTS)
@pytest.mark.parametrize(("samples", "has_any"), [(3, False), (4, True)])
def test_four_stops_have_shared_errors(name, samples, has_any):
    """Fewer show nothing of what changes with the pose."""
    problem = simulated_problem(replace(records(name), samples=samples))
    assert (shared_errors(RANDOM_EFFECTS[name], problem, "hand") is not None) == has_any
