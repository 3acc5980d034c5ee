"""Tests of mixtures of normal distributions weighted by evidence."""

from __future__ import annotations

import numpy as np

from basecal.numerics.mixtures import Gaussian, mixture, probabilities


def test_probabilities_with_evidence_of_any_size():
    """The most likely model has all of the probability, however large the log evidences are."""
    np.testing.assert_allclose(probabilities(np.full(3, 1 / 3), np.array([-5e4, 9e4, 0.0])), [0, 1, 0], atol=1e-300)


def test_prior_and_evidence_multiply():
    """A model with half the prior and four times the evidence is twice as likely in the posterior."""
    np.testing.assert_allclose(probabilities(np.array([2.0, 1.0]), 2 * np.log([1.0, 4.0])), [1 / 3, 2 / 3])


def test_mixture_moments_are_weighted_sums():
    """Mean and second moment are weighted sums over the parts, for many mixtures at once.

    The evidence is the mean of all.
    """
    rng, shares = np.random.default_rng(0), np.array([0.75, 0.25])
    means, roots = rng.standard_normal((5, 2, 6)), rng.standard_normal((5, 2, 6, 6))
    covariances = roots @ roots.mT
    found = mixture(shares, Gaussian(np.full((5, 2), 3.0), means, covariances))
    np.testing.assert_allclose(found.two_log_evidence, 3.0)
    np.testing.assert_allclose(found.mean, 0.75 * means[:, 0] + 0.25 * means[:, 1])
    moments = covariances + means[..., :, None] * means[..., None, :]
    second = 0.75 * moments[:, 0] + 0.25 * moments[:, 1]
    np.testing.assert_allclose(found.covariance + found.mean[:, :, None] * found.mean[:, None], second, atol=1e-12)


def test_parts_are_weighted_by_their_evidence():
    """The evidence of a mixture is the prior-weighted mean of the parts' evidences, however far apart they are."""
    shares, evidence = np.array([0.75, 0.25]), np.array([[2 * np.log(1.0), 2 * np.log(9.0)], [-3000.0, -2000.0]])
    means, covariances = np.array([[[0.0], [4.0]]] * 2), np.ones((2, 2, 1, 1))
    found = mixture(shares, Gaussian(evidence, means, covariances))
    np.testing.assert_allclose(found.two_log_evidence, [2 * np.log(3.0), -2000 + 2 * np.log(0.25)])
    np.testing.assert_allclose(found.mean, [[3.0], [4.0]])
    np.testing.assert_allclose(found.covariance, [[[1 + 0.75 * 0.25 * 16]], [[1.0]]])


def test_mixture_with_any_leading_axes():
    """A single mixture and a grid of mixtures equal those of a row, whatever leading axes the parts have."""
    rng, shares = np.random.default_rng(1), np.array([0.2, 0.5, 0.3])
    parts = Gaussian(rng.normal(size=(4, 2, 3)), rng.normal(size=(4, 2, 3, 2)), np.tile(np.eye(2), (4, 2, 3, 1, 1)))
    grid, row = mixture(shares, parts), mixture(shares, Gaussian(*(each[1] for each in parts)))
    single = mixture(shares, Gaussian(*(each[1, 0] for each in parts)))
    for of_grid, of_row, alone in zip(grid, row, single, strict=True):
        np.testing.assert_allclose(of_grid[1], of_row)
        np.testing.assert_allclose(of_row[0], alone)
    np.testing.assert_allclose(single.two_log_evidence, 2 * np.log(np.exp(parts.two_log_evidence[1, 0] / 2) @ shares))
