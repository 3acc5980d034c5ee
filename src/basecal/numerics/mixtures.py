"""Normal distributions with evidences, their mixtures, and posterior probabilities.

Source: Kass & Raftery 1995 (evidence), Bar-Shalom et al. 2001, 1.4.16 (moments of mixtures).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.geometry import Array


class Gaussian(NamedTuple):
    """Normal distributions: twice the log evidence, (...), mean, (..., q), and covariance, (..., q, q)."""

    two_log_evidence: Array
    mean: Array
    covariance: Array


def mixture(prior: Array, parts: Gaussian) -> Gaussian:
    """Moments and evidence of mixtures of m normal distributions, (..., m), with prior probabilities (m,)."""
    two_log_evidence = parts.two_log_evidence
    weights = probabilities(prior, two_log_evidence)
    mean = (weights[..., None, :] @ parts.mean)[..., 0, :]
    deviation = parts.mean - mean[..., None, :]
    spread = parts.covariance + deviation[..., None] * deviation[..., None, :]
    largest = two_log_evidence.max(-1)
    total = largest + 2 * np.log(np.exp(0.5 * (two_log_evidence - largest[..., None])) @ prior)
    return Gaussian(total, mean, np.einsum("...m,...mij->...ij", weights, spread))


def probabilities(prior: Array, two_log_evidence: Array) -> Array:
    """Posterior probabilities, (..., m), from prior probabilities, (m,), and twice the log evidences, (..., m)."""
    shares = prior * np.exp(0.5 * (two_log_evidence - two_log_evidence.max(-1, keepdims=True)))
    return np.asarray(shares / shares.sum(-1, keepdims=True))
