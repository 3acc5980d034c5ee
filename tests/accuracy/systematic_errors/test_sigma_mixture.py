"""Posteriors of sizes by the priors of their sigmas."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from basecal.accuracy.systematic_errors.sigma_mixture import posteriors_by_sigma
from basecal.effects.faces.effect import SigmaPrior
from basecal.numerics.mixtures import mixture, probabilities


def drawn(rng, options, width):
    """A prior of so many sigmas of so many sizes, the first of them none."""
    sigmas = np.concatenate([np.zeros((1, width)), rng.uniform(0.1, 2, (options - 1, width))])
    return SigmaPrior(sigmas, rng.dirichlet(np.ones(options)))


def all_at_once(gradient, information, priors):
    """Each combination of sigmas alone: logarithms of the evidence, means and covariances, and prior shares."""
    shares, evidences, means, covariances = [], [], [], []
    for each in product(*(zip(p.sigmas, p.shares, strict=True) for p in priors)):
        s = np.diag(np.concatenate([sigmas for sigmas, _ in each]))
        covariance = s @ np.linalg.inv(s @ information @ s + np.eye(len(s))) @ s
        means.append(-covariance @ gradient)
        covariances.append(covariance)
        evidences.append(gradient @ covariance @ gradient - np.linalg.slogdet(s @ information @ s + np.eye(len(s)))[1])
        shares.append(np.prod([share for _, share in each]))
    return tuple(np.array(each) for each in (shares, evidences, means, covariances))


@pytest.mark.parametrize("widths", [(3,), (2, 3), (4, 1, 2), (0, 2, 0)])
def test_levels_are_all_combinations_at_once(widths):
    """Sizes eliminated one level after another have the posterior of every combination of sigmas solved alone."""
    rng, q = np.random.default_rng(3), sum(widths)
    root, gradient = rng.normal(size=(q + 2, q)), rng.normal(size=q)
    priors = [drawn(rng, options, width) for options, width in zip((3, 4, 5), widths, strict=False)]
    shares, evidences, means, covariances = all_at_once(gradient, root.T @ root, priors)
    given = posteriors_by_sigma(gradient, root.T @ root, priors)
    found = mixture(priors[0].shares, given)
    weights = probabilities(shares, evidences)
    mean = weights @ means
    off = means - mean
    np.testing.assert_allclose(found.evidence, 2 * np.log(shares @ np.exp(0.5 * evidences)))
    np.testing.assert_allclose(found.mean, mean, atol=1e-12)
    spread = np.einsum("m,mij->ij", weights, covariances + off[:, :, None] * off[:, None])
    np.testing.assert_allclose(found.covariance, spread, atol=1e-12)
    of_first = weights.reshape(len(priors[0].shares), -1).sum(1)
    np.testing.assert_allclose(probabilities(priors[0].shares, given.evidence), of_first)
