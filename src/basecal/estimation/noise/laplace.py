"""The most likely sigmas of a model, how well they are known, and what that leaves unknown of everything else.

Sigmas that the data hardly tell are integrated over, not fixed: nodes about the most likely ones (a cubature of
Laplace's normal approximation, each node weighed by its own likelihood) give the mean of the covariances and the spread
of the means. Source: Tierney & Kadane 1986; Arasaratnam & Haykin 2009 (nodes); Rue, Martino & Chopin 2009.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from basecal.estimation.noise.hyperpriors import LogNormals
from basecal.estimation.noise.mixed_model import MixedModel
from basecal.estimation.noise.reml import Posterior, open_parts, posterior
from basecal.geometry import Array

_STEP = 0.1
_LEAST_CURVATURE = 0.1
_MOST_OFF = float(np.log(400.0))
_LEAST_OF_VIEWS = float(np.log(20.0))


@dataclass(frozen=True, eq=False)
class SigmaPosterior:
    """The sigmas of a model, given the data.

    Attributes:
        model: The model.
        prior: What was known beforehand.
        logs: (k,) the most likely logarithms.
        covariance: (k, k) of the logarithms.
        surprise: Minus twice the log of the evidence for the model, but for a constant that models share.
    """

    model: MixedModel
    prior: LogNormals
    logs: Array
    covariance: Array
    surprise: float

    @property
    def at_mode(self) -> Posterior:
        """What is known at the most likely sigmas."""
        return posterior(self.model, self.logs)


def most_likely_sigmas(model: MixedModel, prior: LogNormals, start: Array | None = None) -> Array:
    """The most likely logarithms of a model's sigmas, (k,)."""
    first = prior.start if start is None else start
    found = minimize(
        lambda logs: _value(model, prior, logs),
        first,
        method="L-BFGS-B",
        jac=True,
        bounds=_bounds(model, prior),
        options={"ftol": 1e-10, "gtol": 1e-3, "maxiter": 100},
    )
    return np.asarray(found.x)


def _bounds(model: MixedModel, prior: LogNormals) -> list[tuple[float, float]]:
    """Between what logarithms sigmas are looked for: far better than their points scatter, views leave but rounding."""
    views = len(open_parts(model))
    least = [_LEAST_OF_VIEWS if k < views else _MOST_OFF for k in range(len(prior.start))]
    return [(v - down, v + _MOST_OFF) for v, down in zip(prior.start, least, strict=True)]


def sigma_posterior(model: MixedModel, prior: LogNormals, logs: Array) -> SigmaPosterior:
    """How well the most likely sigmas are known, by the curvature there."""
    steps = _STEP * np.eye(len(logs))
    slopes = [(_value(model, prior, logs + h)[1] - _value(model, prior, logs - h)[1]) / (2 * _STEP) for h in steps]
    curvature = np.array(slopes).reshape(len(logs), len(logs))
    values, vectors = np.linalg.eigh(0.25 * (curvature + curvature.T))
    values = np.maximum(values, _LEAST_CURVATURE)
    surprise = posterior(model, logs).value + prior.value(logs)[0] + float(np.log(values / (2 * np.pi)).sum())
    return SigmaPosterior(model, prior, logs, (vectors / values) @ vectors.T, surprise)


def integrated_covariance(models: Sequence[SigmaPosterior], about: Array) -> Array:
    """Covariance of the unknowns about `about`, (p,) from the models' common state, their sigmas and models integrated.

    Models count by their evidence.
    """
    least = min(of.surprise for of in models)
    shares = np.exp(-0.5 * np.array([of.surprise - least for of in models]))
    total = np.zeros((len(about), len(about)))
    for share, of in zip(shares / shares.sum(), models, strict=True):
        total += share * _over_nodes(of, about)
    return total


def _over_nodes(of: SigmaPosterior, about: Array) -> Array:
    k = len(of.logs)
    if not k:
        return _spread(of.at_mode, about)
    root = np.sqrt(k) * np.linalg.cholesky(of.covariance).T
    nodes = of.logs + np.concatenate([root, -root])
    known = [posterior(of.model, node) for node in nodes]
    values = np.array([each.value + of.prior.value(each.logs)[0] for each in known])
    weights = np.exp(-0.5 * (values - values.min()))
    weights /= weights.sum()
    return np.asarray(sum(w * _spread(each, about) for w, each in zip(weights, known, strict=True)))


def _spread(of: Posterior, about: Array) -> Array:
    off = of.step - about
    return of.covariance + np.outer(off, off)


def _value(model: MixedModel, prior: LogNormals, logs: Array) -> tuple[float, Array]:
    """Minus twice the log of what the sigmas' density is proportional to, and its slope."""
    here, before = posterior(model, logs), prior.value(logs)
    return here.value + before[0], here.slope() + before[1]
