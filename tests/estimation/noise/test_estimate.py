"""Sigmas from residuals: how many unknowns the residuals pay for."""

from __future__ import annotations

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.cell import Unknown
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.estimate import degrees_of_freedom, estimate_noise, residual_counts
from basecal.geometry import SE3


def estimated(errors, sigma=None, prior=None):
    """Noise, and the mount, of poses off by `errors`."""
    problem, state = pose_problem(errors, sigma, prior)
    end = bundle_adjust(problem, state, 1, 30)
    problem, end, noise = estimate_noise(problem, end, 30)
    return problem, end, noise


def test_residuals_and_freedoms_are_counted():
    """Three numbers a pose for each of its two sigmas; a prior adds six residuals, the mount takes six away."""
    errors = np.zeros((5, 6))
    assert residual_counts(pose_problem(errors, None)[0]) == {"stated": 0, "pose_m": 15, "pose_rad": 15}
    assert residual_counts(pose_problem(errors, np.ones(6))[0]) == {"stated": 30, "pose_m": 0, "pose_rad": 0}
    prior = Unknown("prior", SE3.identity(), np.ones(6))
    assert degrees_of_freedom(pose_problem(errors, None)[0]) == 24
    assert degrees_of_freedom(pose_problem(errors, None, prior)[0]) == 30


def test_stated_sigmas_that_fit_are_kept(rng):
    """With all sigmas stated nothing is estimated, and nothing scaled, however large the residuals are."""
    errors = 1e-3 * rng.normal(size=(40, 6))
    _, _, noise = estimated(errors, np.full(6, 1e-3))
    assert noise.estimated == ()
    assert noise.factor == 1.0
    _, _, noise = estimated(errors, np.full(6, 1e-4))
    assert noise.factor == 1.0


def test_unstated_sigmas_are_those_of_the_residuals(rng):
    """Of a mount that is free, each sigma is the residuals' with three freedoms less."""
    errors = rng.normal(size=(20, 6)) * np.repeat([2e-3, 5e-4], 3)
    _, _, noise = estimated(errors)
    off = errors - errors.mean(0)
    for part, sigma in ((slice(0, 3), noise.noise.pose_m), (slice(3, 6), noise.noise.pose_rad)):
        assert sigma == pytest.approx(np.sqrt(np.sum(off[:, part] ** 2) / 57), rel=2e-3)
    assert noise.settled
    assert noise.estimated == ("pose_m", "pose_rad")


def test_a_prior_pays_for_a_part_of_the_unknowns(rng):
    """Beside a prior of sigma s the residuals pay for 3 n s^2 / (n s^2 + sigma^2) unknowns: MacKay's gamma."""
    n, width = 8, 1e-3
    errors = 2e-3 * rng.normal(size=(n, 6))
    prior = Unknown("prior", SE3.identity(), np.full(6, width))
    problem, end, noise = estimated(errors, None, prior)
    squares = problem.groups[0].measurement.squares(
        end.state.camera_from_target(problem.groups[0], problem.stops), None
    )
    for name in ("pose_m", "pose_rad"):
        variance = getattr(noise.noise, name) ** 2
        paid = 3 * n * width**2 / (n * width**2 + variance)
        assert 1.5 < paid < 2.9
        assert squares[name] == pytest.approx(3 * n - paid, rel=2e-3)
