"""The largest agreement within a view, alone or with a prior of its pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.outliers.agreeing_samples import agreeing_samples
from basecal.estimation.outliers.view_ransac import Prior, view_ransac
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
