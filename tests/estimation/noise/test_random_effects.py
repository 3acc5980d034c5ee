"""Tests of random effects: errors that the stops of a problem share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.effects.registry import RANDOM_EFFECTS
from basecal.effects.smooth_in_time import errors
from basecal.estimation.noise.random_effects import (
    is_shared_error,
    passed_times,
    posture_at_stops,
    scaled_shared_errors,
    shared_errors,
    shared_term,
)
from basecal.estimation.noise.robot_noise import stop_poses
from basecal.simulation import Scenario
from simulated_problem import simulated_problem

SCENARIO = Scenario(samples=8, joints=True)


def test_posture_at_stops_equals_the_recorded_joints():
    """Each stop with views has its joints, and the others have the mean of the joints."""
    problem = simulated_problem(SCENARIO)
    poses, _ = stop_poses(problem, "hand")
    at = posture_at_stops(problem, "hand")
    np.testing.assert_allclose(at.chain.forward(at.recorded).matrix, poses.matrix, atol=1e-12)
    (group,) = problem.groups
    some = problem.with_groups([group.take(np.arange(1, len(group)))])
    unseen = posture_at_stops(some, "hand").recorded[group.hand.stop_number[0]]
    np.testing.assert_allclose(unseen, np.delete(at.recorded, group.hand.stop_number[0], axis=0).mean(0))


def test_arms_with_poses_or_few_stops_have_no_posture():
    """Joints of arms recorded by poses are unknown, and few stops do not determine joint errors."""
    assert posture_at_stops(simulated_problem(replace(SCENARIO, joints=False)), "hand") is None
    assert posture_at_stops(simulated_problem(replace(SCENARIO, samples=3)), "hand") is None


def problem_with(name, samples):
    """A problem of arms with an effect: by poses alone or by joints, in motion with ten samples a second."""
    problem = simulated_problem(replace(SCENARIO, joints=not RANDOM_EFFECTS[name].is_of_poses_alone, samples=samples))
    return problem.with_ends(lambda end: replace(end, passed_s=0.1 * end.stop_number))


def test_arms_with_joints_have_joint_and_link_errors():
    """Arms recorded by joints have errors of joints and links, but no errors by reach."""
    assert shared_errors(RANDOM_EFFECTS["smooth_by_reach"], simulated_problem(SCENARIO), "hand") is None


@pytest.mark.parametrize("name", RANDOM_EFFECTS)
def test_shared_errors_have_rows_for_each_stop(name):
    """Each stop has six rows, and each error a column. A unit of all rotates the flange by about a unit or a few."""
    problem = problem_with(name, 12)
    errors = shared_errors(RANDOM_EFFECTS[name], problem, "hand")
    assert errors.by_stop.shape == (len(stop_poses(problem, "hand")[0]), 6, len(errors.is_turn))
    turned = errors.flange_sigmas(np.ones(2))[3:]
    assert np.all((turned > 0.1) & (turned < 4))


@pytest.mark.parametrize("name", RANDOM_EFFECTS)
@pytest.mark.parametrize(("samples", "has_any"), [(3, False), (4, True)])
def test_four_stops_have_shared_errors(name, samples, has_any):
    """Fewer stops do not show changes with the pose."""
    problem = problem_with(name, samples)
    assert (shared_errors(RANDOM_EFFECTS[name], problem, "hand") is not None) == has_any


def test_stops_of_still_arms_have_no_time():
    """Other stops have the time of their view."""
    problem = simulated_problem(SCENARIO)
    assert np.isnan(passed_times(problem, "hand")).all()
    moved = problem_with("smooth_in_time", 8)
    np.testing.assert_allclose(passed_times(moved, "hand"), 0.1 * np.arange(8))


def test_temporal_errors_are_modelled_for_one_arm():
    """Errors in time look equal on either arm, but errors by pose belong to each arm."""
    problem = problem_with("smooth_in_time", 8)
    of = {name: shared_term(problem, name, ["eye", "hand"]) for name in ("smooth_in_time", "smooth")}
    assert of["smooth_in_time"].errors.keys() == {"eye"}
    assert of["smooth"].errors.keys() == {"eye", "hand"}
    assert of["smooth"].prior == RANDOM_EFFECTS["smooth"].expected
    assert shared_term(problem, "smooth_in_time", ["hand"]).errors.keys() == {"hand"}
    assert shared_term(problem, "", ["eye"]) is None
    assert shared_term(problem_with("smooth", 3), "smooth", ["eye"]) is None


def test_lasting_errors_are_detected():
    """Independent errors are detected in less than one of twenty of 300 draws.

    Lasting errors of equal size are nearly always.
    """
    times, rng = 0.2 * np.arange(60), np.random.default_rng(0)
    shared = errors(times)
    alone = rng.standard_normal((300, 60, 6))
    lasting = (shared.by_stop @ rng.standard_normal((300, 1, shared.by_stop.shape[-1], 1)))[..., 0]
    assert np.mean([is_shared_error(shared, each) for each in alone]) < 0.05
    assert np.mean([is_shared_error(shared, each) for each in alone + lasting]) > 0.95


def test_shared_errors_are_scaled_by_known_sigmas():
    """For each robot, the errors of all effects are combined."""
    problem, sigmas = problem_with("smooth_in_time", 8), np.array([2e-4, 3e-4])
    held = scaled_shared_errors(
        problem, {"smooth_in_time": {"eye": sigmas}, "smooth": {"eye": sigmas, "hand": 2 * sigmas}}
    )
    of = {name: shared_errors(RANDOM_EFFECTS[name], problem, "eye") for name in ("smooth_in_time", "smooth")}
    variances = [np.sum((held["eye"]) ** 2, -1), sum(np.sum(each.by_stop**2, -1) for each in of.values())]
    np.testing.assert_allclose(variances[0], variances[1] * np.repeat(sigmas, 3) ** 2)
    assert set(held) == {"eye", "hand"}
    assert scaled_shared_errors(problem, {}) == {}
