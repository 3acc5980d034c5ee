"""Tests of problems with changed robot noise."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from tests.ends import with_eye, with_hand
from tests.pose_problem import pose_problem, two_arm_problem

from basecal.estimation.noise import joint_estimate
from basecal.estimation.noise.robot_noise import (
    count_stops,
    recorded_subset,
    some_views,
    stop_poses,
    with_robot_noise,
    without_errors,
)
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import integrate_solution, solve_at_mode, solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

NOISY = (2e-4, 3e-4)
SIGMA = np.repeat(NOISY, 3)


@pytest.mark.parametrize("arms", ["both", "halves", "stations"])
def test_later_noise_equals_stated_noise(arms):
    """Sigmas given to a built problem have the same optimum and covariance as those stated in the cell."""
    made = simulate(Scenario(samples=8, target="points", arms=arms, robot_noise=NOISY, camera_mount="fixed"), seed=2)
    silent = {name: replace(robot, noise=None) for name, robot in made.cell.robots.items()}
    problem, _ = build_problem(replace(made.cell, robots=silent), made.recording)
    stated = solve_problem(build_problem(made.cell, made.recording)[0], made.cell)
    given = solve_problem(with_robot_noise(problem, {"eye": SIGMA, "hand": SIGMA}), made.cell)
    np.testing.assert_allclose(given.covariance, stated.covariance, rtol=1e-6, atol=1e-18)
    assert given.cost == pytest.approx(stated.cost, rel=1e-9)


def test_other_robots_keep_their_noise():
    """Noise given to one robot replaces its own and leaves the other's rows unchanged."""
    s = simulate(Scenario(samples=6, arms="halves", robot_noise=NOISY), seed=0)
    problem, _ = build_problem(s.cell, s.recording)
    changed = with_robot_noise(problem, {"eye": 2 * SIGMA})
    (before,), (after,) = problem.groups, changed.groups
    assert sorted(changed.stops.robot) == sorted(problem.stops.robot)
    np.testing.assert_array_equal(changed.stops.sigma[after.hand.stop], problem.stops.sigma[before.hand.stop])
    np.testing.assert_array_equal(changed.stops.sigma[after.eye.stop], 2 * problem.stops.sigma[before.eye.stop])
    assert {changed.stops.robot[k] for k in after.eye.stop} == {"eye"}


def test_stops_are_counted_with_or_without_noise():
    """A still arm has one stop, a moving one as many as its views show."""
    s = simulate(Scenario(samples=7, arms="hand_still"), seed=0)
    problem, _ = build_problem(s.cell, s.recording)
    assert (count_stops(problem, "eye"), count_stops(problem, "hand")) == (7, 1)


def test_noise_is_given_to_each_stop():
    """A still arm has one stop, the other one for each sample. A robot without views has none."""
    s = simulate(Scenario(samples=7, arms="hand_still"), seed=0)
    problem, _ = build_problem(s.cell, s.recording)
    given = with_robot_noise(problem, dict.fromkeys(("eye", "hand", "another"), SIGMA))
    assert Counter(given.stops.robot) == {"eye": 7, "hand": 1}


def test_stop_numbers_are_those_of_the_recording():
    """With fewer views, stops keep the numbers that they have with all views, except for the missing ones."""
    s = simulate(Scenario(samples=6), seed=0)
    problem, _ = build_problem(s.cell, s.recording)
    noise = {"eye": SIGMA, "hand": SIGMA}
    few = with_robot_noise(problem.with_groups(g.take(np.arange(4)) for g in problem.groups), noise)
    (all_views,), (left,) = with_robot_noise(problem, noise).groups, few.groups
    assert len(few.stops) == 12
    np.testing.assert_array_equal(left.eye.stop, all_views.eye.stop[:4])
    np.testing.assert_array_equal(left.hand.stop, all_views.hand.stop[:4])


def test_unknown_robot_has_no_stop():
    """A robot that is in no view has no stop, no pose, and no error."""
    problem, state = two_arm_problem(np.zeros((3, 6)), [0, 1, 1], [2, 2, 3])
    assert [count_stops(problem, robot) for robot in ("eye", "hand", "another")] == [2, 2, 0]
    poses, seen = stop_poses(problem, "another")
    assert (poses.shape, seen.shape) == ((0,), (0,))
    given = with_robot_noise(problem, {"another": SIGMA})
    assert given.stops.robot == problem.stops.robot
    assert without_errors(given, state).stop_errors.tolist() == [[0.0] * 6] * 4


@pytest.mark.parametrize(("made", "count"), [(0, 4), (4, 4), (5, 5)])
def test_stop_poses_are_the_recorded_poses(made, count):
    """Poses are assigned by stop number, from views in either role. Stops without remaining views have no pose."""
    problem, _ = two_arm_problem(np.zeros((2, 6)), [0, 1], [2, 3])
    (group,) = problem.groups
    poses = SE3.exp(0.1 * np.arange(24.0).reshape(4, 6))
    first = with_hand(group, base_from_flange=poses[:2], stop_number=np.array([3, 1]))
    second = with_hand(
        with_eye(group, robot="hand", base_from_flange=poses[2:3], stop_number=np.array([0])), robot=None
    )
    two = replace(problem.with_groups([first, second.take(np.array([0]))]), stop_counts={"hand": made, "eye": 9})
    found, seen = stop_poses(two, "hand")
    assert seen.tolist() == [True, True, False, True, False][:count]
    for stand, pose in ((3, poses[0]), (1, poses[1]), (0, poses[2])):
        np.testing.assert_array_equal(found[stand].matrix, pose.matrix)
    np.testing.assert_array_equal(found[2].matrix, np.eye(4))
    assert with_robot_noise(two, {"hand": SIGMA}).stops.robot.count("hand") == count


def test_shared_stop_number_is_one_stop():
    """One stop serves the robot as eye and as hand, and rows of views without noise stay -1."""
    problem, _ = two_arm_problem(np.zeros((2, 6)), [-1, -1], [0, 1])
    (group,) = problem.groups
    still = with_hand(with_eye(group, stop_number=np.zeros(2, dtype=int)), stop_number=np.zeros(2, dtype=int))
    of_eye = with_robot_noise(problem.with_groups([still]), {"eye": SIGMA})
    assert of_eye.stops.robot == ("hand", "hand", "eye")
    assert (of_eye.groups[0].eye.stop.tolist(), of_eye.groups[0].hand.stop.tolist()) == ([2, 2], [0, 1])
    of_hand = with_robot_noise(problem.with_groups([still]), {"hand": 2 * SIGMA})
    assert of_hand.stops.robot == ("hand",)
    assert (of_hand.groups[0].eye.stop.tolist(), of_hand.groups[0].hand.stop.tolist()) == ([-1, -1], [0, 0])
    np.testing.assert_array_equal(of_hand.stops.sigma, [2 * SIGMA])
    alone, _ = pose_problem(np.zeros((1, 6)), None)
    given = with_robot_noise(alone, {"eye": SIGMA})
    assert given.stops.robot == ("eye",)
    assert given.groups[0].hand.stop.tolist() == [-1]


NOISY_CELL = Scenario(samples=60, target="pose", robot_noise=(3e-4, 5e-4))


@pytest.mark.parametrize("arms", ["both", "halves", "stations"])
def test_stops_follow_the_selected_views(arms):
    """Every view keeps its stop with sigma and error, and no stop is without a view."""
    made = simulate(replace(NOISY_CELL, arms=arms), 0)
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
    """The first, fourth and last of seven views are the most evenly spread.

    The last stop is kept with the last view.
    """
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
def test_recorded_subset_has_only_its_stops(arms):
    """Every robot has as many stops as its views show, each with its previous pose."""
    made = simulate(replace(NOISY_CELL, arms=arms), 0)
    problem, _ = build_problem(made.cell, made.recording)
    few, state = recorded_subset(problem, State(made.truth, {}, np.zeros((len(problem.stops), 6))), 20)
    (before,), (after,) = problem.groups, few.groups
    assert len(state.stop_errors) == len(few.stops)
    for robot, was, now in (
        ("eye", before.eye.stop_number[::3], after.eye.stop_number),
        ("hand", before.hand.stop_number[::3], after.hand.stop_number),
    ):
        assert set(now) == set(range(few.stop_counts[robot]))
        assert len(set(zip(was.tolist(), now.tolist(), strict=True))) == few.stop_counts[robot]
    noisy = with_robot_noise(few, {"eye": np.ones(6)})
    assert list(noisy.stops.robot).count("eye") == few.stop_counts["eye"]


@pytest.mark.journey
def test_subset_start_does_not_change_the_estimate(monkeypatch):
    """A start from the sigmas of some views changes sigmas, evidence and covariance by at most a thousandth.

    The search ends if a step gains a thousandth of the effect of one standard deviation.
    """
    made = simulate(replace(NOISY_CELL, state_robot_noise=False, state_pixel_noise=False), 0)
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
    # The search of the sigmas uses twenty of the sixty views, and those with three types of shared errors follow.
    assert taken == [20, 20, 40, 20, 40, 20, 40]
    sigmas = [np.concatenate([each.noise.robots[robot] for robot in ("eye", "hand")]) for each in (whole, after)]
    np.testing.assert_allclose(sigmas[1], sigmas[0], rtol=0.02)
    assert after.noise.minus_2_log_evidence == pytest.approx(whole.noise.minus_2_log_evidence, abs=0.05)
    np.testing.assert_allclose(np.diag(after.noise.covariance), np.diag(whole.noise.covariance), rtol=0.02)
