"""Sigmas that are not known make the answer less known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.estimation.noise.test_reml import NOISY, ROBOTS, at_truth

from basecal.estimation.noise.hyperpriors import hyperpriors
from basecal.estimation.noise.laplace import integrated_covariance, sigma_posterior
from basecal.estimation.noise.mixed_model import mixed_model
from basecal.estimation.noise.reml import posterior
from quick import quick


def test_integrating_over_sigmas_widens_the_covariance():
    """The most likely sigmas are stationary, and the covariance integrated over them is larger than at them."""
    model = mixed_model(*at_truth(NOISY), ROBOTS)
    prior = hyperpriors(model, dict.fromkeys(ROBOTS, 0.5))
    found = sigma_posterior(model, prior)
    assert np.abs(found.at_mode.slope() + prior.value(found.logs)[1]).max() < 0.1
    whole = integrated_covariance([found], found.at_mode.step)
    assert np.trace(whole[:6, :6]) > 1.02 * np.trace(found.at_mode.covariance[:6, :6])


@pytest.mark.parametrize(("samples", "seed"), quick([(4, 2), (5, 3)], [(4, 2)]))
def test_tails_of_few_stops_are_integrated(samples, seed):
    """The covariance is that of 4,000 nodes weighed by prior and likelihood of the sigmas, to a tenth.

    Those differ by 2 % among themselves; nodes at one distance from the mode are short by a fifth here.
    """
    model = mixed_model(*at_truth(replace(NOISY, samples=samples), seed), ROBOTS)
    prior = hyperpriors(model, dict.fromkeys(ROBOTS, 0.5))
    found = sigma_posterior(model, prior)
    whole = integrated_covariance([found], found.at_mode.step)[:6, :6]
    rng, width = np.random.default_rng(seed), 2.0 * np.linalg.cholesky(found.covariance)
    total, weight = np.zeros((6, 6)), 0.0
    for _ in range(4000):
        step = rng.standard_normal(len(found.logs))
        known = posterior(model, found.logs + width @ step)
        minus_log = 0.5 * (known.value + prior.value(known.logs)[0] - found.surprise) - 0.5 * step @ step
        off = (known.step - found.at_mode.step)[:6]
        share = np.exp(-minus_log)
        total += share * (known.covariance[:6, :6] + np.outer(off, off))
        weight += share
    ratio = np.trace(np.linalg.solve(total / weight, whole)) / 6
    assert 0.9 < ratio < 1.1
