"""Sigmas that are not known make the answer less known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.estimation.noise.test_reml import NOISY, ROBOTS, at_truth

from basecal.estimation.noise.hyperpriors import CommonPrior, hyperpriors
from basecal.estimation.noise.laplace import integrated_covariance, moments, sigma_posterior
from basecal.estimation.noise.mixed_model import mixed_model
from basecal.estimation.noise.reml import columns_given, sigmas_of
from basecal.estimation.noise.robot_noise import stops_made
from basecal.estimation.noise.terms.common_errors import CommonErrors
from quick import quick


def test_integrating_over_sigmas_widens_the_covariance():
    """The most likely sigmas are stationary, and the covariance integrated over them is larger than at them."""
    model = mixed_model(*at_truth(NOISY), ROBOTS)
    prior = hyperpriors(model, dict.fromkeys(ROBOTS, 0.5))
    found = sigma_posterior(model, prior)
    assert np.abs(found.at_mode.slope() + prior.value(found.logs)[1]).max() < 0.1
    whole = integrated_covariance([found], found.at_mode.step)
    assert np.trace(whole[:6, :6]) > 1.02 * np.trace(found.at_mode.covariance[:6, :6])


def test_models_count_by_how_much_likelier_one_is():
    """However unlikely both are: of two alike the covariance is that of either."""
    model = mixed_model(*at_truth(NOISY), ROBOTS)
    found = sigma_posterior(model, hyperpriors(model, dict.fromkeys(ROBOTS, 0.5)))
    alone = integrated_covariance([found], found.at_mode.step)
    for surprise in (-1e5, 0.0, 1e5):
        both = [replace(found, surprise=surprise), replace(found, surprise=surprise)]
        np.testing.assert_allclose(integrated_covariance(both, found.at_mode.step), alone, rtol=1e-9)


@pytest.mark.parametrize(("samples", "seed", "nodes"), quick([(4, 2, 1500), (5, 3, 4000)], [(4, 2, 1500)]))
def test_tails_of_few_stops_are_integrated(samples, seed, nodes):
    """The covariance is that of many nodes weighed by prior and likelihood of the sigmas, to a tenth.

    Those differ by 3 % among themselves, of five stops with 4,000; nodes at one distance from the mode are short by a
    fifth here.
    """
    model = mixed_model(*at_truth(replace(NOISY, samples=samples), seed), ROBOTS)
    prior = hyperpriors(model, dict.fromkeys(ROBOTS, 0.5))
    found = sigma_posterior(model, prior)
    whole = integrated_covariance([found], found.at_mode.step)[:6, :6]
    rng, width = np.random.default_rng(seed), 2.0 * np.linalg.cholesky(found.covariance)
    total, weight = np.zeros((6, 6)), 0.0
    for _ in range(nodes):
        step = rng.standard_normal(len(found.logs))
        known = columns_given(model, found.logs + width @ step)
        minus_log = 0.5 * (known.value + prior.value(known.logs)[0] - found.surprise) - 0.5 * step @ step
        off = (known.step - found.at_mode.step)[:6]
        share = np.exp(-minus_log)
        total += share * (known.covariance[:6, :6] + np.outer(off, off))
        weight += share
    ratio = np.trace(np.linalg.solve(total / weight, whole)) / 6
    assert 0.9 < ratio < 1.1


def test_moments_are_of_the_whole_posterior():
    """Of the unknowns they are the covariance integrated about the state; of sigmas more than of the likeliest."""
    problem, state = at_truth(NOISY)
    shared = {robot: CommonErrors.in_every_coordinate(np.ones((stops_made(problem, robot), 1))) for robot in ROBOTS}
    model = mixed_model(problem, state, ROBOTS, shared)
    found = sigma_posterior(model, hyperpriors(model, dict.fromkeys(ROBOTS, 0.5), CommonPrior((2.5, 2.0))))
    columns = np.arange(len(model.prior))
    mean, covariance, squares = moments(found, columns)
    products = covariance + np.outer(mean, mean)
    whole = integrated_covariance([found], np.zeros(model.width))
    np.testing.assert_allclose(products[: model.width, : model.width], whole, rtol=1e-9, atol=1e-9 * whole.max())
    assert np.all(squares > np.exp(2 * found.logs))
    # What all stops have in common cannot be told from mounts and bases: it is as large as its sigma says, in metres.
    for robot in ROBOTS:
        first = model.layout.common[robot][0]
        own = np.diag(products)[first : first + 6]
        expected = squares[sigmas_of(model, robot).start + 2 * len(ROBOTS) :][:2].repeat(3)
        assert np.all(own < 1.05 * expected)
        assert own.max() > 0.5 * expected.max()
