"""Cauchy's likelihood over views: outliers pull little, and every batch entry has its own scale."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import MOUNT, pose_problem

from basecal.estimation.least_squares import cauchy_irls as module
from basecal.estimation.least_squares.bundle_adjustment import batch_states, bundle_adjust
from basecal.estimation.least_squares.cauchy_irls import cauchy_irls
from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared

SIGMA = np.full(6, 1e-3)


def with_outliers(count, size=0.05):
    """Thirty poses with noise, the first `count` off by `size` in every number."""
    errors = 1e-3 * np.random.default_rng(0).standard_normal((30, 6))
    errors[:count] += size
    return pose_problem(errors, SIGMA)


def mount(states, row=0):
    return states.transforms[MOUNT].log()[row]


def test_three_tenths_of_outliers_pull_hardly():
    """Least squares is off by 15 mm, Cauchy's likelihood by less than a tenth of that; the batch does not mix."""
    problem, state = with_outliers(9)
    plain = bundle_adjust(problem, state, 1).state.transforms[MOUNT].log()
    assert np.abs(plain[:3]).min() > 0.014
    robust = cauchy_irls(problem, batch_states(problem, [state, state]))
    assert np.abs(mount(robust)).max() < 1e-3
    np.testing.assert_allclose(mount(robust, 1), mount(robust, 0), atol=1e-9)


def test_it_is_where_the_weighted_forces_balance():
    """The weights 1 / (1 + d^2 / s), with s the quantile of six tenths of d^2, leave no force at the end."""
    problem, state = with_outliers(3, 0.01)
    at = mount(cauchy_irls(problem, batch_states(problem, [state])))
    errors = problem.groups[0].measurement.measured_camera_from_target.log()
    off = (errors + at) / SIGMA  # the mount moves the target in the camera backwards
    ratio = np.sum(off**2, -1) / 6
    weight = 1 / (1 + ratio / np.quantile(ratio, 0.6))
    step = (weight @ off) / weight.sum()
    assert np.abs(step[:3]).max() < 0.02
    assert np.abs((np.ones(30) @ off) / 30)[:3].max() > 0.5


def test_exact_views_are_no_error():
    """Without noise the scale is none, and the answer exact."""
    problem, state = pose_problem(np.zeros((10, 6)), SIGMA)
    np.testing.assert_allclose(mount(cauchy_irls(problem, batch_states(problem, [state]))), 0.0, atol=1e-12)


@pytest.mark.parametrize("fails_at", [None, 4])
def test_a_few_steps_without_weights_are_followed_by_one_of_each_weights(monkeypatch, fails_at):
    """By squares over freedoms of all groups, each state's own scale; where there is no step all stays."""
    values = np.array([[6.0, 12.0, np.inf], [1.0, 2.0, 3.0]]), np.array([[30.0, 0.0], [4.0, 5.0]])
    freedoms = np.array([[6, 6, 6], [1, 1, 1]]), np.array([[6, 0], [2, 1]])
    steps = []

    def adjusted(problem, states, dof, iterations, weights):
        if len(steps) == fails_at:
            raise np.linalg.LinAlgError
        steps.append((iterations, weights))
        return SimpleNamespace(state=states + 1)

    monkeypatch.setattr(module, "bundle_adjust_batch", adjusted)
    squares = [MahalanobisSquared(*each) for each in zip(values, freedoms, strict=True)]
    monkeypatch.setattr(module, "studentize_views", lambda problem, states: squares)
    assert cauchy_irls(None, 0) == len(steps) == (fails_at or 25)
    assert [iterations for iterations, _ in steps] == [3, *[1] * (len(steps) - 1)]
    assert steps[0][1] is None
    scale = np.array([[3.2], [2.4]])  # six tenths of 0, 1, 2, 5 and what is beyond; of 1, 2, 2, 3 and 5
    expected = [1 / (1 + np.array(of) / scale) for of in ([[1, 2, np.inf], [1, 2, 3]], [[5, 0], [2, 5]])]
    for _, weights in steps[1:]:
        for found, wanted in zip(weights, expected, strict=True):
            np.testing.assert_allclose(found, wanted, atol=1e-25)
