"""Truncated least squares by graduated weights: outliers end with no weight at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import MOUNT, pose_problem

from basecal.estimation.outliers.reweighted import graduated_truncation
from basecal.estimation.outliers.robust_scale import Scale, robust_scale
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

CHANCE = 1e-4
SIGMA = np.full(6, 1e-3)


def stated(squares):
    return Scale(1.0, np.inf, np.inf, CHANCE)


def mount(state):
    return state.transforms[MOUNT].log()


@pytest.mark.parametrize(("count", "size"), [(0, 0.0), (6, 0.02), (6, 5.0)])
def test_the_end_is_the_mean_of_the_inliers(count, size):
    """With six of twenty poses off by 20 sigmas, or by metres, as if they had not been recorded."""
    errors = 1e-3 * np.random.default_rng(0).standard_normal((20, 6))
    errors[:count, :3] += size
    problem, state = pose_problem(errors, SIGMA)
    np.testing.assert_allclose(mount(graduated_truncation(problem, state, stated)), -errors[count:].mean(0), atol=1e-5)


def test_a_scale_that_is_estimated_serves_too():
    """Sigmas that nobody stated: the scale comes from the deviations in each round."""
    errors = 1e-2 * np.random.default_rng(1).standard_normal((30, 6))
    errors[:8] += 0.5
    problem, state = pose_problem(errors, SIGMA)
    end = graduated_truncation(problem, state, lambda squares: robust_scale(squares, 6, False, CHANCE))
    np.testing.assert_allclose(mount(end), -errors[8:].mean(0), atol=2e-3)


def test_single_points_of_views_of_few_are_weighted_by_themselves():
    """One of five points of every other view is 40 px off: the base is as without these, to 0.1 mm and mrad."""
    made = simulate(Scenario(samples=10, target="points"), 3)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    pixels, weight = group.measurement.pixels.copy(), group.measurement.weight.copy()
    pixels[::2, 1] += (35.0, -20.0)
    weight[::2, 1] = 0.0
    truth = State(made.truth, made.cameras, np.zeros((0, 6)))
    astray = problem.with_groups([replace(group, measurement=replace(group.measurement, pixels=pixels))])
    without = problem.with_groups([replace(group, measurement=replace(group.measurement, weight=weight))])
    ours, clean = (graduated_truncation(p, truth, stated) for p in (astray, without))
    name = "eye_base_from_hand_base"
    off = (ours.transforms[name].inverse() @ clean.transforms[name]).log()
    np.testing.assert_allclose(off, 0.0, atol=1e-4)


def test_a_start_that_is_pulled_aside_does_not_matter():
    """From 30 mm and mrad off the same end."""
    errors = 1e-3 * np.random.default_rng(2).standard_normal((20, 6))
    errors[:6] += 0.05
    problem, state = pose_problem(errors, SIGMA)
    away = replace(state, transforms={**state.transforms, MOUNT: SE3.exp(np.full(6, -0.03))})
    np.testing.assert_allclose(
        mount(graduated_truncation(problem, away, stated)),
        mount(graduated_truncation(problem, state, stated)),
        atol=1e-6,
    )
