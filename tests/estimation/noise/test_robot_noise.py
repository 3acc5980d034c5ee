"""Problems with other noise of their robots."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.noise.robot_noise import stops_made, with_robot_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve_packed
from basecal.simulation import Scenario, simulate

NOISY = (2e-4, 3e-4)
SIGMA = np.repeat(NOISY, 3)


@pytest.mark.parametrize("arms", ["both", "halves", "stations"])
def test_noise_given_later_is_noise_that_was_stated(arms):
    """Sigmas given to a packed problem make the problem of a cell that states them: one optimum, one covariance."""
    told = simulate(Scenario(samples=8, target="points", arms=arms, robot_noise=NOISY, camera_mount="fixed"), seed=2)
    silent = {name: replace(robot, noise=None) for name, robot in told.cell.robots.items()}
    problem, _ = build_problem(replace(told.cell, robots=silent), told.recording)
    stated = solve_packed(build_problem(told.cell, told.recording)[0], told.cell)
    given = solve_packed(with_robot_noise(problem, {"eye": SIGMA, "hand": SIGMA}), told.cell)
    np.testing.assert_allclose(given.covariance, stated.covariance, rtol=1e-6, atol=1e-18)
    assert given.cost == pytest.approx(stated.cost, rel=1e-9)


def test_others_keep_their_noise():
    """Noise given to one robot replaces its own and leaves the other's rows as they were."""
    s = simulate(Scenario(samples=6, arms="halves", robot_noise=NOISY), seed=0)
    problem, _ = build_problem(s.cell, s.recording)
    changed = with_robot_noise(problem, {"eye": 2 * SIGMA})
    (before,), (after,) = problem.groups, changed.groups
    assert sorted(changed.stops.robot) == sorted(problem.stops.robot)
    np.testing.assert_array_equal(changed.stops.sigma[after.hand_stop], problem.stops.sigma[before.hand_stop])
    np.testing.assert_array_equal(changed.stops.sigma[after.eye_stop], 2 * problem.stops.sigma[before.eye_stop])
    assert {changed.stops.robot[k] for k in after.eye_stop} == {"eye"}


def test_stops_are_counted_with_or_without_noise():
    """A still arm made one stop, a moving one as many as it was seen at."""
    s = simulate(Scenario(samples=7, arms="hand_still"), seed=0)
    problem, _ = build_problem(s.cell, s.recording)
    assert (stops_made(problem, "eye"), stops_made(problem, "hand")) == (7, 1)


def test_noise_is_given_to_each_stop_and_to_no_more():
    """One of a still arm, one a sample of the other; none of a robot that stands in no view."""
    s = simulate(Scenario(samples=7, arms="hand_still"), seed=0)
    problem, _ = build_problem(s.cell, s.recording)
    given = with_robot_noise(problem, dict.fromkeys(("eye", "hand", "another"), SIGMA))
    assert Counter(given.stops.robot) == {"eye": 7, "hand": 1}


def test_numbers_of_stops_are_those_of_the_recording():
    """Noise given to the views that are left numbers their stops as noise given to all does, the last one lacking."""
    s = simulate(Scenario(samples=6), seed=0)
    problem, _ = build_problem(s.cell, s.recording)
    noise = {"eye": SIGMA, "hand": SIGMA}
    few = with_robot_noise(problem.with_groups(g.take(np.arange(4)) for g in problem.groups), noise)
    (all_views,), (left,) = with_robot_noise(problem, noise).groups, few.groups
    assert len(few.stops) == 12
    np.testing.assert_array_equal(left.eye_stop, all_views.eye_stop[:4])
    np.testing.assert_array_equal(left.hand_stop, all_views.hand_stop[:4])
