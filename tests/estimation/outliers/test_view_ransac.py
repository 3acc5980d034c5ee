"""The largest agreement within a view, alone or with a prior of its pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.outliers import view_ransac as ransac
from basecal.estimation.outliers.agreeing_samples import agreeing_samples
from basecal.estimation.outliers.view_ransac import Prior, largest_agreement, subset_fits, view_ransac
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

LIMIT = 27.6


def truth_of(scenario, seed):
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    return problem, state, state.camera_from_target(problem.groups[0], problem.stops)


def test_a_third_of_a_boards_points_wrong():
    """Twelve of 36 points of every view at random places: found, all of them and no other, from a start 5 cm off."""
    problem, state, true = truth_of(Scenario(samples=8), 0)
    measurement = problem.groups[0].measurement
    rng = np.random.default_rng(0)
    wrong = rng.permuted(np.tile(np.arange(36) < 12, (8, 1)), axis=1)
    pixels = np.where(wrong[..., None], rng.uniform((0, 0), (1280, 720), (8, 36, 2)), measurement.pixels)
    near = true @ SE3.exp(rng.uniform(-0.05, 0.05, (8, 6)))
    found = view_ransac(replace(measurement, pixels=pixels), near, state.cameras["wrist"], LIMIT)
    np.testing.assert_array_equal(found.points, ~wrong)


def test_a_prior_decides_where_points_alone_cannot():
    """Of five points three wrong: with the pose known to 0.1 mm and 0.1 mrad the other two are told from them."""
    problem, state, true = truth_of(Scenario(samples=6, target="points", robot_noise=(1e-5, 1e-5)), 2)
    measurement = problem.groups[0].measurement
    assert measurement.seen.shape == (6, 5)
    wrong = np.tile(np.arange(5) < 3, (6, 1))
    pixels = measurement.pixels + np.where(wrong[..., None], (9.0, -14.0), 0.0) * np.arange(1, 6)[:, None]
    prior = Prior(true, np.tile(1e8 * np.eye(6), (6, 1, 1)))
    found = view_ransac(replace(measurement, pixels=pixels), true, state.cameras["wrist"], LIMIT, prior)
    np.testing.assert_array_equal(found.points, ~wrong)


def test_samples_that_close_the_loop_are_told_apart():
    """Ten of twenty samples with poses 50 mm off: at the truth the other ten stand clear; of clean ones none do."""
    problem, state, _ = truth_of(Scenario(samples=20), 1)
    group = problem.groups[0]
    shift = np.zeros((20, 6))
    shift[10:, :3] = 0.05
    moved = replace(group, hand_base_from_hand_flange=group.hand_base_from_hand_flange @ SE3.exp(shift))
    assert agreeing_samples(problem.with_groups([moved]), [state]) == tuple(range(10))
    assert agreeing_samples(problem, [state]) == ()


def strays(problem, count, seed):
    """The views of a problem's first group with `count` points of each at random places."""
    measurement = problem.groups[0].measurement
    n, p = measurement.seen.shape
    rng = np.random.default_rng(seed)
    wrong = rng.permuted(np.tile(np.arange(p) < count, (n, 1)), axis=1)
    pixels = np.where(wrong[..., None], rng.uniform((0, 0), (1280, 720), (n, p, 2)), measurement.pixels)
    return replace(measurement, pixels=pixels), wrong


@pytest.mark.parametrize("target", ["chessboard", "points"])
def test_how_many_are_fitted_at_once_changes_nothing(target, monkeypatch):
    """Hypotheses one by one give the poses, points and costs that all of them side by side do."""
    problem, state, true = truth_of(Scenario(samples=5, target=target), 3)
    measurement, _ = strays(problem, 2, 3)
    near = true @ SE3.exp(np.random.default_rng(4).uniform(-0.02, 0.02, (5, 6)))
    together = view_ransac(measurement, near, state.cameras["wrist"], LIMIT)
    monkeypatch.setattr(ransac, "_CHUNK_POINTS", 1)
    alone = view_ransac(measurement, near, state.cameras["wrist"], LIMIT)
    np.testing.assert_array_equal(together.points, alone.points)
    np.testing.assert_allclose(together.cost, alone.cost, rtol=1e-6)
    np.testing.assert_allclose((together.camera_from_target.inverse() @ alone.camera_from_target).log(), 0.0, atol=1e-6)


def test_hypotheses_serve_every_limit():
    """Fitted once, the poses that views may have give for each limit what a search for that limit gives."""
    problem, state, true = truth_of(Scenario(samples=5), 5)
    measurement, wrong = strays(problem, 9, 5)
    lens = state.cameras["wrist"]
    poses = subset_fits(measurement, true, lens)
    assert poses.translation.shape == (42, 5, 3)
    for limit in (LIMIT, 30 * LIMIT):
        found, anew = largest_agreement(measurement, poses, lens, limit), view_ransac(measurement, true, lens, limit)
        np.testing.assert_array_equal(found.points, anew.points)
        np.testing.assert_array_equal(found.cost, anew.cost)
        np.testing.assert_array_equal(found.points & wrong, False)


def test_a_view_of_a_single_point_agrees_with_its_prior_alone():
    """There is no subset of one point: the point is kept where the prior puts it, and left out 40 px aside."""
    problem, state, true = truth_of(Scenario(samples=6, target="led", robot_noise=(1e-5, 1e-5)), 6)
    measurement = problem.groups[0].measurement
    aside = np.arange(6) < 2
    pixels = measurement.pixels + np.where(aside[:, None, None], (40.0, 0.0), 0.0)
    prior = Prior(true, np.tile(1e10 * np.eye(6), (6, 1, 1)))
    found = view_ransac(replace(measurement, pixels=pixels), true, state.cameras["wrist"], LIMIT, prior)
    np.testing.assert_array_equal(found.points[:, 0], ~aside)


@pytest.mark.parametrize(("points", "subsets"), [(4, 4 + 6), (5, 5 + 10), (8, 8 + 28)])
def test_of_few_points_all_but_one_or_two(points, subsets):
    """Up to eight points every subset without one or two of them is tried, each once."""
    found = ransac._subsets(np.ones((1, points), dtype=bool))[:, 0]
    assert len(found) == subsets
    assert len(np.unique(found, axis=0)) == subsets
    assert set(found.sum(1).tolist()) == {points - 1, points - 2}


def test_of_many_points_random_fives(rng):
    """Of nine points and more forty subsets of five that a view sees, in each view others; of four seen all four."""
    seen = np.ones((3, 30), dtype=bool)
    seen[1, ::2] = False
    seen[2, 4:] = False
    found = ransac._subsets(seen)
    assert found.shape == (40, 3, 30)
    assert np.all(found[:, :2].sum(-1) == 5)
    np.testing.assert_array_equal(found[:, 2], np.tile(seen[2], (40, 1)))
    assert not np.any(found & ~seen)
    assert len(np.unique(found[:, 0], axis=0)) > 35
    assert ransac._subsets(np.ones((1, 9), dtype=bool)).shape == (40, 1, 9)
