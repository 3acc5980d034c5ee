"""Mixtures of normal distributions by evidence."""

from __future__ import annotations

import numpy as np

from basecal.numerics.mixtures import Gaussian, mixture, probabilities


def test_evidences_of_any_size_have_shares():
    """The most likely has all, however large the numbers are."""
    np.testing.assert_allclose(probabilities(np.full(3, 1 / 3), np.array([-5e4, 9e4, 0.0])), [0, 1, 0], atol=1e-300)


def test_priors_and_evidence_multiply():
    """A model that is half as likely before, and four times by its evidence, is twice as likely after."""
    np.testing.assert_allclose(probabilities(np.array([2.0, 1.0]), 2 * np.log([1.0, 4.0])), [1 / 3, 2 / 3])


def test_a_mixture_has_the_moments_of_its_parts():
    """Mean and second moment are the shares' sums, for many mixtures at once; the evidence is the mean of all."""
    rng, shares = np.random.default_rng(0), np.array([0.75, 0.25])
    means, roots = rng.standard_normal((5, 2, 6)), rng.standard_normal((5, 2, 6, 6))
    covariances = roots @ roots.mT
    found = mixture(shares, Gaussian(np.full((5, 2), 3.0), means, covariances))
    np.testing.assert_allclose(found.two_log_evidence, 3.0)
    np.testing.assert_allclose(found.mean, 0.75 * means[:, 0] + 0.25 * means[:, 1])
    moments = covariances + means[..., :, None] * means[..., None, :]
    second = 0.75 * moments[:, 0] + 0.25 * moments[:, 1]
    np.testing.assert_allclose(found.covariance + found.mean[:, :, None] * found.mean[:, None], second, atol=1e-12)


def test_parts_count_by_their_evidence():
    """Of a mixture the evidence is the mean of the parts' by their priors, however far apart they are."""
    shares, evidence = np.array([0.75, 0.25]), np.array([[2 * np.log(1.0), 2 * np.log(9.0)], [-3000.0, -2000.0]])
    means, covariances = np.array([[[0.0], [4.0]]] * 2), np.ones((2, 2, 1, 1))
    found = mixture(shares, Gaussian(evidence, means, covariances))
    np.testing.assert_allclose(found.two_log_evidence, [2 * np.log(3.0), -2000 + 2 * np.log(0.25)])
    np.testing.assert_allclose(found.mean, [[3.0], [4.0]])
    np.testing.assert_allclose(found.covariance, [[[1 + 0.75 * 0.25 * 16]], [[1.0]]])


def test_a_single_mixture_and_a_grid_of_them_are_those_of_a_row():
    """Whatever axes stand before the parts, or none."""
    rng, shares = np.random.default_rng(1), np.array([0.2, 0.5, 0.3])
    parts = Gaussian(rng.normal(size=(4, 2, 3)), rng.normal(size=(4, 2, 3, 2)), np.tile(np.eye(2), (4, 2, 3, 1, 1)))
    grid, row = mixture(shares, parts), mixture(shares, Gaussian(*(each[1] for each in parts)))
    single = mixture(shares, Gaussian(*(each[1, 0] for each in parts)))
    for of_grid, of_row, alone in zip(grid, row, single, strict=True):
        np.testing.assert_allclose(of_grid[1], of_row)
        np.testing.assert_allclose(of_row[0], alone)
    np.testing.assert_allclose(single.two_log_evidence, 2 * np.log(np.exp(parts.two_log_evidence[1, 0] / 2) @ shares))
