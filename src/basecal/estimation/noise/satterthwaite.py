"""How well estimated sigmas are known: the degrees of freedom of the covariance that rests on them.

A covariance of nu degrees of freedom makes squared errors weighed by it larger by nu / (nu - 2) in the mean, as a
chi-square becomes an F. Source: Satterthwaite 1946; docs/mathematics.md (5.3).
"""

from __future__ import annotations

import numpy as np

from basecal.estimation.noise.estimate import NoiseEstimate, degrees_of_freedom
from basecal.estimation.noise.marginal_likelihood import (
    MarginalLikelihood,
    VarianceComponents,
    VarianceModel,
    information_of,
    log_sigma_covariance,
    marginal_likelihood,
    neg2_log_likelihood,
)
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array

_STEP = 1e-2


def freedoms_of(problem: Problem, state: State, noise: NoiseEstimate, name: str) -> float:
    """Effective degrees of freedom of the covariance of one unknown; infinite where no sigma was estimated.

    With v the mean over directions of the variance of the logarithm of the unknown's variance, nu = 2 / v.

    Args:
        problem: The problem with the noise in use.
        state: Its optimum.
        noise: That noise.
        name: A name among the problem's columns.
    """
    if not noise.robots:
        return float(degrees_of_freedom(problem)) if noise.estimated or noise.factor != 1.0 else float("inf")
    found = components_of(problem, state, noise)
    evidence = marginal_likelihood(problem, state, noise.noise)
    slopes = _slopes(evidence, found, problem.columns[name])
    covariance = log_sigma_covariance(evidence, found)
    variance = np.einsum("iab,jba,ij->", slopes, slopes, covariance) / slopes.shape[-1]
    return float(2 / variance) if variance > 0 else float("inf")


def components_of(problem: Problem, state: State, noise: NoiseEstimate) -> VarianceComponents:
    """The sigmas in use as the components that they were found as."""
    pairs: dict[tuple[float, float], list[str]] = {}
    for robot, sigma in noise.robots.items():
        pairs.setdefault((float(sigma[0]), float(sigma[3])), []).append(robot)
    model = VarianceModel(noise.estimated, tuple(tuple(robots) for robots in pairs.values()))
    values = [getattr(noise.noise, name) for name in noise.estimated] + [v for pair in pairs for v in pair]
    logs = np.log(np.array(values, dtype=np.float64))
    evidence = marginal_likelihood(problem, state, noise.noise)
    return VarianceComponents(model, logs, neg2_log_likelihood(evidence, model, logs))


def _slopes(evidence: MarginalLikelihood, found: VarianceComponents, where: slice) -> Array:
    """Derivatives of the whitened covariance of an unknown to the logarithms of the sigmas, (k, m, m)."""

    def covariance(logs: Array) -> Array:
        """Of the unknown, at these logarithms of the sigmas, (m, m)."""
        whole = np.linalg.inv(information_of(evidence, found.model, logs))
        return np.asarray(whole[where, where], dtype=np.float64)

    white = np.linalg.inv(np.linalg.cholesky(covariance(found.logs)))
    steps = _STEP * np.eye(len(found.logs))
    changes = [(covariance(found.logs + h) - covariance(found.logs - h)) / (2 * _STEP) for h in steps]
    return np.array([white @ change @ white.T for change in changes])
