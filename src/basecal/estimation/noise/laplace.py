"""Posterior of the sigmas of a model by Laplace's approximation, and covariances integrated over it.

Sigmas that the data hardly determine are integrated over, not fixed. Nodes are placed about the mode by a cubature of
Laplace's normal approximation. Weighted by their likelihoods, they yield the mean of the covariances and the spread of
the means. With few views, variances have tails that the few nodes of a cubature miss. Nodes are then sampled from a
distribution wider than the approximation, with importance weights. Source: Tierney & Kadane 1986; Arasaratnam & Haykin
2009 (nodes); Kloek & van Dijk 1978 (importance sampling); Rue, Martino & Chopin 2009.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from basecal.estimation.noise.hyperpriors import LogNormals
from basecal.estimation.noise.mixed_model import MixedModel
from basecal.estimation.noise.reml import (
    Columns,
    Equations,
    Posterior,
    node_equations,
    posterior,
    scales,
    solve_columns,
)
from basecal.geometry import Array, IntArray
from basecal.numerics.batch import take
from basecal.numerics.mixtures import probabilities
from basecal.numerics.spectral import floored_spectrum, scaled_spectrum, spectrum

# Maximum number of Newton steps, and of halvings of a step that increases the value.
_NEWTON_STEPS, _HALVINGS = 50, 12
# Number of recent steps that correct the curvature: older ones are too far away.
_SECANT_COUNT = 2
# Largest step of a logarithm: the value is nearly quadratic only over a change of the sigma by a small factor.
_LARGEST_STEP = 1.0
# Decrease of minus twice the log likelihood at which the search ends: one standard deviation changes it by 1.
_SETTLED_STEP = 3e-3
# Standard deviation of a logarithm up to which the cubature's mean variance is within 7 %: cosh 1 in place of exp 1/2.
_NEARLY_NORMAL_SIGMA = 0.5
# Standard deviation of a logarithm up to which its sigma counts as known: its spread adds at most 0.5 % of covariance.
_KNOWN_SIGMA = 0.05
# The same limit for the quick integral: its spread adds about 10 %.
_NEARLY_KNOWN_SIGMA = 0.25
# Maximum number of blocks for sampled nodes: with more, a poorly known sigma hardly affects the answer.
_MOST_SAMPLED_BLOCKS = 40
# Sampled nodes: half their number, degrees of freedom of Student's t, and its scale relative to the approximation.
_NODE_PAIRS, _STUDENT_DOF, _STUDENT_SCALE = 64, 5.0, 1.2
_SEED = 20240422  # arbitrary
_LEAST_SHARE = 1e-6  # smallest probability of a model: at it, a hundred times the covariance would add 0.01 %
_LIKELY_SHARE = 0.1  # smallest probability of a model in the quick integral: less likely ones change sigmas by some %
_LEAST_CURVATURE = 0.1  # in a logarithm: a factor of about 20, wider than any prior; avoids endless steps at saddles
_SEARCH_RANGE = float(np.log(400.0))  # search range of a logarithm about its expected value, wide enough for any device
_VIEW_SEARCH_RANGE = float(
    np.log(20.0)
)  # search range below it for views: smaller sigmas are rounding of synthetic data
_PARALLEL = 1e-8  # cosine of step and correction below which the pair has no information on the curvature
_LEAST_CURVATURE_SHARE = (
    0.2  # smallest share of the curvature that a correction may leave: a smaller one makes steps too long
)
_EIGENVALUE_FLOOR = 1e-300  # floor of eigenvalues that leaves a regular matrix unchanged


@dataclass(frozen=True, eq=False)
class SigmaPosterior:
    """Posterior of the sigmas of a model, given the data.

    Attributes:
        model: The model.
        prior: Prior of the logarithms of the sigmas.
        logs: (k,) most likely logarithms.
        covariance: (k, k) covariance of the logarithms.
        minus_2_log_evidence: Minus twice the log of the evidence for the model, up to a constant that models share.
    """

    model: MixedModel
    prior: LogNormals
    logs: Array
    covariance: Array
    minus_2_log_evidence: float

    @cached_property
    def columns(self) -> Columns:
        """Posterior of all columns at the most likely sigmas, cached since it is used repeatedly."""
        return take(solve_columns(node_equations(self.model, self.logs[None]), np.arange(len(self.model.prior))), 0)

    @cached_property
    def nodes(self) -> _Nodes:
        """Nodes of the sigmas, cached for all requested columns."""
        return _Nodes.place(self)


def sigma_posterior(model: MixedModel, prior: LogNormals, start: Array | None = None) -> SigmaPosterior:
    """Find the most likely sigmas of a model, and their covariance from the curvature at the mode.

    Args:
        model: The model.
        prior: Prior of the logarithms of the sigmas.
        start: (j,) start values of the first logarithms; the others start at the prior's.
    """
    count = len(prior.start)
    logs = prior.start if start is None else np.append(start[:count], prior.start[len(start) :])
    logs, surface = _find_mode(model, prior, logs)
    curvature = floored_spectrum(0.5 * surface.curvature, _LEAST_CURVATURE)
    minus_2_log_evidence = surface.value + float(np.log(curvature.values / (2 * np.pi)).sum())
    return SigmaPosterior(model, prior, logs, curvature.inverse, minus_2_log_evidence)


def _find_mode(model: MixedModel, prior: LogNormals, start: Array) -> tuple[Array, _Surface]:
    """Find the most likely logarithms, (k,), by Newton steps with the average information as curvature."""
    lower, upper = _bounds(model, prior)
    logs = np.clip(start, lower, upper)
    surface = _Surface(posterior(model, logs), prior)
    secants: list[Secant] = []
    for _ in range(_NEWTON_STEPS):
        step = _bounded_step(surface.slope, surface.curvature, logs, lower, upper, secants)
        step = np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
        expected = -float(surface.slope @ step)
        for _ in range(_HALVINGS):
            candidate = np.clip(logs + step, lower, upper)
            candidate_surface = _Surface(posterior(model, candidate), prior)
            if candidate_surface.value <= surface.value:
                break
            step = step / 2
        else:
            return logs, surface
        if expected < _SETTLED_STEP:
            return candidate, candidate_surface
        secants = [*secants, Secant(candidate - logs, candidate_surface.slope - surface.slope)][-_SECANT_COUNT:]
        logs, surface = candidate, candidate_surface
    return logs, surface


@dataclass(frozen=True, eq=False)
class _Surface:
    """Minus twice the log of the unnormalised density of the sigmas, at some sigmas."""

    posterior: Posterior
    prior: LogNormals

    @cached_property
    def value(self) -> float:
        """Value."""
        return self.posterior.value + self.prior.value(self.posterior.logs)[0]

    @cached_property
    def slope(self) -> Array:
        """Gradient, (k,)."""
        return self.posterior.slope() + self.prior.value(self.posterior.logs)[1]

    @cached_property
    def curvature(self) -> Array:
        """Curvature, (k, k)."""
        return self.posterior.average_information() + self.prior.curvature


def _bounded_step(
    slope: Array, curvature: Array, logs: Array, lower: Array, upper: Array, secants: Sequence[Secant]
) -> Array:
    """Newton step, (k,), zero for logarithms at an active bound."""
    is_bounded = ((logs <= lower) & (slope > 0)) | ((logs >= upper) & (slope < 0))
    # The value rises exponentially in a logarithm: twice the gradient, zero at the mode, is added to the curvature.
    curvature = correct_curvature(curvature + np.diag(2 * np.maximum(slope, 0.0)), secants)
    inverse = floored_spectrum(np.where(is_bounded[:, None] | is_bounded, 0.0, curvature), _LEAST_CURVATURE).inverse
    return np.asarray(-inverse @ np.where(is_bounded, 0.0, slope))


def _bounds(model: MixedModel, prior: LogNormals) -> tuple[Array, Array]:
    """Bounds of the search, (k,) each: sigmas of views far below the scatter of their points are rounding errors."""
    lower_range = np.where(model.sigmas.is_of_views, _VIEW_SEARCH_RANGE, _SEARCH_RANGE)
    return prior.start - lower_range, prior.start + _SEARCH_RANGE


def integrated_covariance(
    models: Sequence[SigmaPosterior], prior: Array, origin: Array, is_quick: bool = False
) -> Array:
    """Covariance of the unknowns, (p, p), averaged over models and integrated over their sigmas.

    Args:
        models: Posteriors of the sigmas of n models about one state.
        prior: (n,) prior probabilities of the models, which are weighted by their evidence.
        origin: (p,) step from the state to the point about which second moments are taken.
        is_quick: Whether to use only nodes of the cubature and likely models.
    """
    shares = probabilities(prior, -np.array([model.minus_2_log_evidence for model in models]))
    shares = np.where(shares > (_LIKELY_SHARE if is_quick else _LEAST_SHARE), shares, 0.0)
    total = np.zeros((len(origin), len(origin)))
    for share, model in zip(shares / shares.sum() if is_quick else shares, models, strict=True):
        if share:
            weights, _, columns = _weighted_nodes(model, np.arange(len(origin)), is_quick)
            total += share * _second_moments(weights, columns.mean - origin, columns.spread)
    return total


def moments(posterior: SigmaPosterior, columns: IntArray) -> tuple[Array, Array, Array]:
    """Posterior mean and covariance of columns, over the posterior of the sigmas.

    Args:
        posterior: Posterior of the sigmas of a model.
        columns: (c,) indices of columns.

    Returns:
        Mean, (c,), and covariance, (c, c), of the columns' values about the model's state, in metres and radians.
        Means of the squared sigmas, (k,).
    """
    weights, nodes, at_nodes = _weighted_nodes(posterior, columns)
    sigmas = scales(nodes, posterior.model.of_columns[columns])
    means = at_nodes.mean * sigmas
    mean = weights @ means
    products = _second_moments(weights, means, at_nodes.spread * sigmas[:, :, None] * sigmas[:, None, :])
    return mean, products - np.outer(mean, mean), weights @ np.exp(2 * nodes)


def _second_moments(weights: Array, means: Array, covariances: Array) -> Array:
    """Second moments about zero, (c, c), of a mixture of normals: weights (n,), means (n, c), covariances (n, c, c)."""
    return np.asarray(np.tensordot(weights, covariances, 1) + (weights * means.T) @ means)


def _weighted_nodes(
    posterior: SigmaPosterior, columns: IntArray, is_quick: bool = False
) -> tuple[Array, Array, Columns]:
    """Weighted nodes that represent the posterior of the sigmas, and the posterior of some columns at each.

    Returns:
        Weights, (n,), that add up to 1; logarithms of the sigmas, (n, k); and the columns.
    """
    nodes = _Nodes.place(posterior, is_quick) if is_quick else posterior.nodes
    at_nodes = solve_columns(nodes.equations, columns)
    values = at_nodes.value + np.array([posterior.prior.value(node)[0] for node in nodes.logs])
    values = np.where(np.isfinite(values), values, np.inf) - nodes.minus_2_log_density
    weights = np.exp(-0.5 * (values - values.min()))
    is_used = weights > 0  # other nodes may be non-finite
    return weights[is_used] / weights.sum(), nodes.logs[is_used], take(at_nodes, is_used)


class _Nodes(NamedTuple):
    """Nodes of the sigmas.

    Attributes:
        logs: (n, k) logarithms.
        minus_2_log_density: (n,) of the distribution that they are sampled from, up to a constant.
        equations: Equations of the columns at the nodes.
    """

    logs: Array
    minus_2_log_density: Array
    equations: list[Equations]

    @classmethod
    def place(cls, posterior: SigmaPosterior, is_quick: bool = False) -> _Nodes:
        """Place nodes: the mode if all sigmas are well known, samples if some are poorly known, else a cubature."""
        variances, model = np.diag(posterior.covariance), posterior.model
        if np.sqrt(variances).max(initial=0.0) < (_NEARLY_KNOWN_SIGMA if is_quick else _KNOWN_SIGMA):
            logs, minus_2_log_density = posterior.logs[None], np.zeros(1)
        elif variances.max() > _NEARLY_NORMAL_SIGMA**2 and model.layout.blocks <= _MOST_SAMPLED_BLOCKS and not is_quick:
            logs, minus_2_log_density = _draw_nodes(posterior)
        else:
            logs, minus_2_log_density = _cubature(posterior, is_quick)
        return cls(logs, minus_2_log_density, node_equations(model, logs))


def _cubature(posterior: SigmaPosterior, is_quick: bool = False) -> tuple[Array, Array]:
    """Nodes of a cubature, (2 r, k), and minus twice the log of their density up to a constant, (2 r,).

    The nodes lie along all directions of the logarithms; the quick integral omits directions that are nearly known.
    """
    root = _root(posterior.covariance)
    if is_quick:
        wide = scaled_spectrum(posterior.covariance, _NEARLY_KNOWN_SIGMA**2)
        root = wide.root[:, wide.is_informative].T
    steps = np.sqrt(len(root)) * root
    return posterior.logs + np.concatenate([steps, -steps]), np.zeros(2 * len(root))


def _draw_nodes(posterior: SigmaPosterior) -> tuple[Array, Array]:
    """Sample nodes from Student's t about the mode, in antithetic pairs, with a fixed seed; see `_cubature`."""
    rng, k = np.random.default_rng(_SEED), len(posterior.logs)
    normal = rng.standard_normal((_NODE_PAIRS, k))
    steps = normal * np.sqrt(_STUDENT_DOF / rng.chisquare(_STUDENT_DOF, _NODE_PAIRS))[:, None]
    steps = np.concatenate([steps, -steps])
    density = (_STUDENT_DOF + k) * np.log1p(np.sum(steps**2, -1) / _STUDENT_DOF)
    nodes = posterior.logs + _STUDENT_SCALE * steps @ _root(posterior.covariance)
    return np.clip(nodes, *_bounds(posterior.model, posterior.prior)), density


def _root(covariance: Array) -> Array:
    """Matrix R with R'R equal to a covariance, (k, k): rows along its principal axes.

    The axes do not depend on the order of the sigmas, so that answers do not depend on names of robots and cameras.
    """
    root = spectrum(covariance).root.T
    return np.asarray(root * np.where(root.sum(axis=1) < 0, -1.0, 1.0)[:, None])


class Secant(NamedTuple):
    """A step, (k,), and the change of the gradient over it, (k,)."""

    step: Array
    change: Array


def correct_curvature(curvature: Array, secants: Sequence[Secant]) -> Array:
    """Correct a positive definite curvature, (k, k), to reproduce observed gradient changes, if it stays regular.

    The average information equals the observed information to within the scatter of the data. If errors of two robots
    have nearly the same effect, it is wrong by up to a factor of two. Newton steps with it alone then oscillate. Each
    pair of a step and of the change of the gradient over it defines a symmetric correction of rank one.
    Source: Broyden 1967; Conn, Gould & Toint 1991 (when to skip a correction).
    """
    for step, change in secants:
        missing = change - curvature @ step
        along = float(missing @ step)
        if abs(along) <= _PARALLEL * float(np.linalg.norm(missing) * np.linalg.norm(step)):
            continue
        remaining_share = 1 + floored_spectrum(curvature, _EIGENVALUE_FLOOR).squared_mahalanobis(missing) / along
        if remaining_share > _LEAST_CURVATURE_SHARE:
            curvature = curvature + np.outer(missing, missing) / along
    return curvature
