"""Some of the views are a problem like any other, and lead to the sigmas of all of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.estimation.noise import joint_estimate
from basecal.estimation.noise.robot_noise import with_robot_noise
from basecal.estimation.noise.some_views import recorded_subset, some_views
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import integrate_solution, solve_at_mode
from basecal.simulation import Scenario, simulate

NOISY = Scenario(samples=60, target="pose", robot_noise=(3e-4, 5e-4))


@pytest.mark.parametrize("arms", ["both", "halves", "stations"])
def test_stops_are_those_of_the_views_kept(arms):
    """Every view has the stop, its sigma and its error that it had, and no stop is without a view."""
    made = simulate(replace(NOISY, arms=arms), 0)
    problem, _ = build_problem(made.cell, made.recording)
    errors = np.arange(6.0 * len(problem.stops)).reshape(-1, 6)
    few, state = some_views(problem, State(made.truth, {}, errors), 20)
    (before,), (after,) = problem.groups, few.groups
    assert after.sample.tolist() == before.sample[::3].tolist()
    for was, now in ((before.eye.stop[::3], after.eye.stop), (before.hand.stop[::3], after.hand.stop)):
        np.testing.assert_array_equal(state.stop_errors[now], errors[was])
        np.testing.assert_array_equal(few.stops.sigma[now], problem.stops.sigma[was])
        assert [few.stops.robot[k] for k in now] == [problem.stops.robot[k] for k in was]
    assert set(after.eye.stop) | set(after.hand.stop) == set(range(len(few.stops)))


def test_views_without_a_stop_have_none():
    """Of seven views the first, fourth and last are spread most evenly; the last stop is kept with the last view."""
    problem, state = pose_problem(np.zeros((7, 6)), None, stop_sigma=np.ones(6))
    problem = problem.with_groups([*problem.groups, problem.groups[0].take(np.zeros(0, dtype=int))])
    state = replace(state, stop_errors=np.arange(42.0).reshape(7, 6))
    few, at = some_views(problem, state, 3)
    (group,) = few.groups
    assert group.sample.tolist() == [0, 3, 6]
    assert (group.eye.stop.tolist(), group.hand.stop.tolist()) == ([0, 1, 2], [-1] * 3)
    np.testing.assert_array_equal(at.stop_errors, state.stop_errors[[0, 3, 6]])
    assert [len(some_views(problem, state, most)[0].groups[0]) for most in (1, 6, 7, 8)] == [1, 4, 7, 7]


@pytest.mark.parametrize("arms", ["both", "halves", "stations"])
def test_recorded_alone_places_have_their_views(arms):
    """Every robot has as many places as views of it show, each with the pose that it had."""
    made = simulate(replace(NOISY, arms=arms), 0)
    problem, _ = build_problem(made.cell, made.recording)
    few, state = recorded_subset(problem, State(made.truth, {}, np.zeros((len(problem.stops), 6))), 20)
    (before,), (after,) = problem.groups, few.groups
    assert len(state.stop_errors) == len(few.stops)
    for robot, was, now in (
        ("eye", before.eye.stand[::3], after.eye.stand),
        ("hand", before.hand.stand[::3], after.hand.stand),
    ):
        assert set(now) == set(range(few.stands[robot]))
        assert len(set(zip(was.tolist(), now.tolist(), strict=True))) == few.stands[robot]
    noisy = with_robot_noise(few, {"eye": np.ones(6)})
    assert list(noisy.stops.robot).count("eye") == few.stands["eye"]


def test_sigmas_are_those_of_all_views(monkeypatch):
    """Started from those of some views, the sigmas, their evidence and the covariance are as without, to a thousandth.

    The search ends where a step gains a thousandth of what one standard deviation changes.
    """
    made = simulate(replace(NOISY, state_robot_noise=False, state_pixel_noise=False), 0)
    problem, _ = build_problem(made.cell, made.recording)
    start = State(made.truth, {}, np.zeros((len(problem.stops), 6)))

    def found():
        return integrate_solution(solve_at_mode(problem, start, Settings(robot_noise="estimated"), ()))

    whole = found()
    taken = []
    monkeypatch.setattr(joint_estimate, "MANY_VIEWS", 40)
    monkeypatch.setattr(joint_estimate, "_SOME_VIEWS", (20, 40))
    monkeypatch.setattr(joint_estimate, "some_views", lambda *of: taken.append(of[2]) or some_views(*of))
    after = found()
    # The search of the sigmas, which is among thirty of the sixty, and those with errors in common of three kinds.
    assert taken == [20, 20, 40, 20, 40, 20, 40]
    sigmas = [np.concatenate([each.noise.robots[robot] for robot in ("eye", "hand")]) for each in (whole, after)]
    np.testing.assert_allclose(sigmas[1], sigmas[0], rtol=0.02)
    assert after.noise.minus_2_log_evidence == pytest.approx(whole.noise.minus_2_log_evidence, abs=0.05)
    np.testing.assert_allclose(np.diag(after.noise.covariance), np.diag(whole.noise.covariance), rtol=0.02)
