"""Sigmas that are not known make the answer less known."""

from __future__ import annotations

import numpy as np
from tests.estimation.noise.test_reml import NOISY, ROBOTS, at_truth

from basecal.estimation.noise.hyperpriors import hyperpriors
from basecal.estimation.noise.laplace import integrated_covariance, sigma_posterior
from basecal.estimation.noise.mixed_model import mixed_model


def test_integrating_over_sigmas_widens_the_covariance():
    """The most likely sigmas are stationary, and the covariance integrated over them is larger than at them."""
    model = mixed_model(*at_truth(NOISY), ROBOTS)
    prior = hyperpriors(model, dict.fromkeys(ROBOTS, 0.5))
    found = sigma_posterior(model, prior)
    assert np.abs(found.at_mode.slope() + prior.value(found.logs)[1]).max() < 0.1
    whole = integrated_covariance([found], found.at_mode.step)
    assert np.trace(whole[:6, :6]) > 1.02 * np.trace(found.at_mode.covariance[:6, :6])
