"""Tests of `refit_folds`: fits without held-out samples."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, views
from tests.pose_problem import MOUNT, pose_problem

from basecal.accuracy.cross_validation.folds import splits
from basecal.accuracy.cross_validation.refit import _known_stops, refit_folds, with_known_stops
from basecal.accuracy.cross_validation.validation import cross_validate
from basecal.estimation.least_squares import sparse_normal_equations
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate


def test_refit_uses_other_samples_only():
    """Samples are either used or held out. Stops that no used sample shares stay at zero, known ones do not."""
    made = simulate(Scenario(samples=12, arms="stations", stations=4, robot_noise=(3e-4, 5e-4)), 0)
    solution = solve(made.cell, made.recording)
    held = frozenset({0, 1, 2})
    (fit,) = refit_folds(solution.problem, solution.state, [held], 100)
    assert {int(n) for g in fit.views.groups for n in g.sample} == held
    assert {int(n) for g in fit.used.groups for n in g.sample} == set(range(3, 12))
    assert 0 < fit.known.sum() < len(fit.known)
    assert not np.any(fit.optimum.state.stop_errors[~fit.known])
    assert np.all(np.any(fit.optimum.state.stop_errors[fit.known] != 0, axis=-1))


def test_prediction_problem_may_be_wider():
    """Views that the fitted problem lacks are predicted if the wider problem contains them."""
    made = simulate(Scenario(samples=12), 0)
    solution = solve(made.cell, made.recording)
    fewer = solution.problem.with_groups(g.take(np.flatnonzero(g.sample != 3)) for g in solution.problem.groups)
    (fit,) = refit_folds(fewer, solution.state, [frozenset({3, 4})], 100, prediction_problem=solution.problem)
    assert {int(n) for g in fit.views.groups for n in g.sample} == {3, 4}
    assert {int(n) for g in fit.used.groups for n in g.sample} == set(range(12)) - {3, 4}


def test_parallel_folds_equal_separate_fits():
    """Each of three parallel folds equals the separate fit of its views, with stops that arms share."""
    made = simulate(Scenario(samples=12, arms="halves", robot_noise=(3e-4, 5e-4)), 0)
    solution = solve(made.cell, made.recording)
    folds = [frozenset(range(k, 12, 3)) for k in range(3)]
    for fit in refit_folds(solution.problem, solution.state, folds, 100):
        alone = bundle_adjust(fit.used, with_known_stops(solution.state, fit.known), degrees_of_freedom(fit.used))
        assert fit.optimum.cost == pytest.approx(alone.cost, rel=1e-9)
        np.testing.assert_allclose(fit.optimum.state.stop_errors, alone.state.stop_errors, atol=1e-4)
        size = np.sqrt(np.diag(alone.normal.hessian))
        off = (fit.optimum.hessian - alone.normal.hessian) / np.outer(size, size)
        np.testing.assert_allclose(off, 0.0, atol=1e-5)


@pytest.mark.journey
def test_sparse_folds_equal_dense_folds(monkeypatch):
    """A ring of three robots, treated as many, has the states, information and spread of dense matrices."""
    made = simulate(Scenario(layout="ring", robots=3, samples=36, robot_noise=(1e-4, 1e-4)), 1)
    solution = solve(made.cell, made.recording)
    dense = cross_validate(solution, made.cell.requested_transforms)
    monkeypatch.setattr(sparse_normal_equations, "MANY_COLUMNS", 1)
    sparse = cross_validate(solution, made.cell.requested_transforms)
    assert dense.spread.mean_square == pytest.approx(sparse.spread.mean_square, rel=1e-6)
    assert dense.spread.freedoms == pytest.approx(sparse.spread.freedoms, rel=1e-6)
    assert dense.summary.rms_px == pytest.approx(sparse.summary.rms_px, rel=1e-6)
    (folds, *_) = splits(solution.problem)
    (one, *_) = refit_folds(solution.problem, solution.state, folds.folds[:1], 50)
    assert one.sparse is not None
    np.testing.assert_allclose(one.optimum.hessian, one.sparse.matrix.toarray())


@pytest.mark.parametrize("weighed", [False, True])
def test_refit_is_weighted_mean_of_used_views(weighed):
    """For poses near the identity the refit is the weighted mean of the used views; held-out ones do not count."""
    rng = np.random.default_rng(2)
    errors, worth = 1e-6 * rng.standard_normal((9, 6)), rng.uniform(0.1, 1.0, 9)
    problem, state = pose_problem(errors, np.full(6, 1e-3))
    folds = [frozenset({0, 4}), frozenset(), frozenset({8})]
    fits = refit_folds(problem, state, folds, 20, view_weights=[worth] if weighed else None)
    for fit, held in zip(fits, folds, strict=True):
        used = np.setdiff1d(np.arange(9), list(held))
        weight = worth[used] if weighed else np.ones(len(used))
        mean = np.average(errors[used], axis=0, weights=weight)
        found = fit.optimum.state.transforms[MOUNT].log()
        np.testing.assert_allclose(found, -mean, atol=1e-10)  # flange_from_camera is the inverse
        np.testing.assert_allclose(fit.optimum.hessian, 1e6 * weight.sum() * np.eye(6), rtol=1e-4, atol=100.0)
        assert fit.held == held
        assert sum(map(len, fit.views.groups)) == len(held)


def test_stops_of_used_views_are_known():
    """Stops of either arm with a used view are known; views without a stop know none, not even the last."""
    groups = views(end(stop=[0, -1]), end(stop=[3, -1])), views(end(stop=[1]), end(stop=[-1]))
    found = _known_stops(SimpleNamespace(stops=range(6), groups=groups))
    assert found.tolist() == [True, True, False, True, False, False]
    state = State({}, {}, np.arange(1.0, 37.0).reshape(6, 6))
    np.testing.assert_array_equal(with_known_stops(state, found).stop_errors, state.stop_errors * found[:, None])
