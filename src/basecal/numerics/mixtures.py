"""Normal distributions with evidences, their mixtures, and posterior probabilities.

Source: Kass & Raftery 1995 (evidence), Bar-Shalom et al. 2001, 1.4.16 (moments of mixtures).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.geometry import Array


class Gaussian(NamedTuple):
    """Normal distributions: twice the log evidence, (...), mean, (..., q), and covariance, (..., q, q)."""

    evidence: Array
    mean: Array
    covariance: Array


def mixture(prior: Array, parts: Gaussian) -> Gaussian:
    """Moments and evidence of mixtures of m normal distributions, (..., m), with prior probabilities (m,)."""
    evidence = parts.evidence
    shares = probabilities(prior, evidence)
    mean = (shares[..., None, :] @ parts.mean)[..., 0, :]
    off = parts.mean - mean[..., None, :]
    spread = parts.covariance + off[..., None] * off[..., None, :]
    most = evidence.max(-1)
    total = most + 2 * np.log(np.exp(0.5 * (evidence - most[..., None])) @ prior)
    return Gaussian(total, mean, np.einsum("...m,...mij->...ij", shares, spread))


def probabilities(prior: Array, evidence: Array) -> Array:
    """Posterior probabilities, (..., m), from prior probabilities, (m,), and twice the log evidences, (..., m)."""
    shares = prior * np.exp(0.5 * (evidence - evidence.max(-1, keepdims=True)))
    return np.asarray(shares / shares.sum(-1, keepdims=True))
