"""The most likely sigmas of a model, how well they are known, and what that leaves unknown of everything else.

Sigmas that the data hardly determine are integrated over, not fixed. Nodes are placed about the most likely ones, by a
cubature of Laplace's normal approximation. Weighted by their likelihoods, they give the mean of the covariances and the
spread of the means. With few views, variances have tails that so few nodes do not reach. Nodes are then drawn more
widely than the approximation, with importance weights. Source: Tierney & Kadane 1986; Arasaratnam & Haykin 2009
(nodes); Kloek & van Dijk 1978 (importance sampling); Rue, Martino & Chopin 2009.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from basecal.estimation.noise.hyperpriors import LogNormals
from basecal.estimation.noise.mixed_model import MixedModel
from basecal.estimation.noise.reml import Columns, Equations, node_equations, posterior, scales, solve_columns
from basecal.geometry import Array, IntArray
from basecal.numerics.batch import take
from basecal.numerics.mixtures import probabilities
from basecal.numerics.spectral import floored_spectrum, scaled_spectrum, spectrum

# Newton's steps, at most, and how often one that leads uphill is halved.
_NEWTON_STEPS, _HALVINGS = 50, 12
# So many steps tell of the curvature: older ones were elsewhere.
_REMEMBERED = 2
# The longest step of a logarithm: what is quadratic in it is so over a few times.
_LONGEST = 1.0
# What a last step gains of minus twice the log likelihood: three thousandths of what one standard deviation changes.
_SETTLED_STEP = 3e-3
# Of a logarithm's standard deviation, up to which the nodes hold the mean of its variances to 7 %, cosh 1 for exp 1/2.
_NEARLY_NORMAL = 0.5
# Likewise, up to which they count as known: a covariance grows by no more than five thousandths by their spread.
_KNOWN_SIGMA = 0.05
# Likewise for the quick integral: by a tenth.
_NEARLY_KNOWN = 0.25
# Of blocks of stops: of more, a sigma that is not known so well is of what hardly moves the answer.
_FEW_STOPS = 40
# Of drawn nodes: half their number, freedoms of Student's t, and how much wider it is than the approximation.
_PAIRS, _TAILS, _WIDER = 64, 5.0, 1.2
_SEED = 20240422  # any other would do
_LEAST_SHARE = 1e-6  # of a model: with a smaller one a hundred times the covariance adds a ten-thousandth
_LIKELY_SHARE = 0.1  # of a model, for the quick integral: less likely ones change a sigma by some hundredths
_LEAST_CURVATURE = 0.1  # of a logarithm no prior leaves so wide, a factor of 20: keeps saddles from endless steps
_MOST_OFF = float(np.log(400.0))  # how far a sigma is looked for from what is expected: any device's is within
_LEAST_OF_VIEWS = float(np.log(20.0))  # how far below that those of views: less is rounding of made-up data
_PARALLEL = 1e-8  # cosine of step and correction: below it the pair says nothing of the curvature along the step
_LEAST_LEFT = 0.2  # of the curvature along a correction that lowers it: less makes steps too long
_REGULAR = 1e-300  # what is regular already is not changed by it


@dataclass(frozen=True, eq=False)
class SigmaPosterior:
    """The sigmas of a model, given the data.

    Attributes:
        model: The model.
        prior: What was known beforehand.
        logs: (k,) the most likely logarithms.
        covariance: (k, k) of the logarithms.
        minus_2_log_evidence: Minus twice the log of the evidence for the model, but for a constant that models share.
    """

    model: MixedModel
    prior: LogNormals
    logs: Array
    covariance: Array
    minus_2_log_evidence: float

    @cached_property
    def columns(self) -> Columns:
        """Posterior of the columns at these sigmas, kept since it is used repeatedly."""
        return take(solve_columns(node_equations(self.model, self.logs[None]), np.arange(len(self.model.prior))), 0)

    @cached_property
    def nodes(self) -> _Nodes:
        """Nodes of the sigmas, kept for all columns that are requested."""
        return _Nodes.place(self)


def sigma_posterior(model: MixedModel, prior: LogNormals, start: Array | None = None) -> SigmaPosterior:
    """The most likely sigmas of a model, and how well they are known, by the curvature there.

    Args:
        model: The model.
        prior: What is known beforehand.
        start: (j,) the first logarithms where they may be; those expected beforehand in place of others that it lacks.
    """
    count = len(prior.start)
    logs = prior.start if start is None else np.append(start[:count], prior.start[len(start) :])
    logs, here = _find_mode(model, prior, logs)
    curvature = floored_spectrum(0.5 * here.curvature, _LEAST_CURVATURE)
    minus_2_log_evidence = here.value + float(np.log(curvature.values / (2 * np.pi)).sum())
    return SigmaPosterior(model, prior, logs, curvature.inverse, minus_2_log_evidence)


def _find_mode(model: MixedModel, prior: LogNormals, start: Array) -> tuple[Array, _Surface]:
    """The most likely logarithms, (k,), by Newton's steps downhill, by the average information."""
    least, most = _bounds(model, prior)
    logs = np.clip(start, least, most)
    here = _Surface.evaluate(model, prior, logs)
    secants: list[Secant] = []
    for _ in range(_NEWTON_STEPS):
        step = np.clip(_bounded_step(here, logs, least, most, secants), -_LONGEST, _LONGEST)
        expected = -float(here.slope @ step)
        for _ in range(_HALVINGS):
            candidate = np.clip(logs + step, least, most)
            there = _Surface.evaluate(model, prior, candidate)
            if there.value <= here.value:
                break
            step = step / 2
        else:
            return logs, here
        secants = [*secants, Secant(candidate - logs, there.slope - here.slope)][-_REMEMBERED:]
        logs, here = candidate, there
        if expected < _SETTLED_STEP:
            break
    return logs, here


@dataclass(frozen=True, eq=False)
class _Surface:
    """Minus twice the log of what the sigmas' density is proportional to, its slope (k,) and curvature (k, k)."""

    value: float
    slope: Array
    curvature: Array

    @classmethod
    def evaluate(cls, model: MixedModel, prior: LogNormals, logs: Array) -> _Surface:
        """Evaluate at logarithms of the sigmas, (k,)."""
        known, (value, slope) = posterior(model, logs), prior.value(logs)
        return cls(known.value + value, known.slope() + slope, known.average_information() + prior.curvature)


def _bounded_step(here: _Surface, logs: Array, least: Array, upper: Array, secants: Sequence[Secant]) -> Array:
    """Newton's step of those logarithms that no bound holds, (k,)."""
    held = ((logs <= least) & (here.slope > 0)) | ((logs >= upper) & (here.slope < 0))
    # A variance's own second derivative adds twice the slope, which at the mode is none: walls are exponential.
    curvature = correct_curvature(here.curvature + np.diag(2 * np.maximum(here.slope, 0.0)), secants)
    inverse = floored_spectrum(np.where(held[:, None] | held, 0.0, curvature), _LEAST_CURVATURE).inverse
    return np.asarray(-inverse @ np.where(held, 0.0, here.slope))


def _bounds(model: MixedModel, prior: LogNormals) -> tuple[Array, Array]:
    """Between what logarithms sigmas are looked for: far better than their points scatter, views leave but rounding."""
    down = np.where(model.sigmas.is_of_views, _LEAST_OF_VIEWS, _MOST_OFF)
    return prior.start - down, prior.start + _MOST_OFF


def integrated_covariance(
    models: Sequence[SigmaPosterior], prior: Array, model: Array, is_quick: bool = False
) -> Array:
    """Covariance of the unknowns about `model`, (p,) from the models' common state, their sigmas and models integrated.

    Models count by their prior probabilities, (n,), and their evidence. The quick integral uses the nodes of the
    cubature alone, and the likely models.
    """
    shares = probabilities(prior, -np.array([of.minus_2_log_evidence for of in models]))
    shares = np.where(shares > (_LIKELY_SHARE if is_quick else _LEAST_SHARE), shares, 0.0)
    total = np.zeros((len(model), len(model)))
    for share, of in zip(shares / shares.sum() if is_quick else shares, models, strict=True):
        if share:
            weights, _, known = _weighed_nodes(of, np.arange(len(model)), is_quick)
            total += share * _second_moments(weights, known.mean - model, known.spread)
    return total


def moments(posterior: SigmaPosterior, columns: IntArray) -> tuple[Array, Array, Array]:
    """Posterior mean and covariance of columns, over the posterior of the sigmas.

    Args:
        posterior: The sigmas of a model.
        columns: (c,) some of its columns.

    Returns:
        Mean, (c,), and covariance, (c, c), of the columns' values about the model's state, in metres and radians.
        Means of the squares of the sigmas, (k,).
    """
    weights, nodes, known = _weighed_nodes(posterior, columns)
    sigmas = scales(nodes, posterior.model.of_columns[columns])
    means = known.mean * sigmas
    mean = weights @ means
    products = _second_moments(weights, means, known.spread * sigmas[:, :, None] * sigmas[:, None, :])
    return mean, products - np.outer(mean, mean), weights @ np.exp(2 * nodes)


def _second_moments(weights: Array, means: Array, covariances: Array) -> Array:
    """Second moments about zero, (c, c), of normals with weights (n,), means (n, c) and covariances (n, c, c)."""
    return np.asarray(np.tensordot(weights, covariances, 1) + (weights * means.T) @ means)


def _weighed_nodes(
    posterior: SigmaPosterior, columns: IntArray, is_quick: bool = False
) -> tuple[Array, Array, Columns]:
    """Nodes of the sigmas that stand for their distribution, and estimates of some columns at each.

    Returns:
        Weights, (n,), that add up to 1; logarithms of the sigmas, (n, k); and the columns.
    """
    nodes = _Nodes.place(posterior, is_quick) if is_quick else posterior.nodes
    known = solve_columns(nodes.equations, columns)
    values = known.value + np.array([posterior.prior.value(node)[0] for node in nodes.logs])
    values = np.where(np.isfinite(values), values, np.inf) - nodes.drawn
    weights = np.exp(-0.5 * (values - values.min()))
    counts = weights > 0  # others may hold what is no number
    return weights[counts] / weights.sum(), nodes.logs[counts], take(known, counts)


class _Nodes(NamedTuple):
    """Nodes of the sigmas.

    Attributes:
        logs: (n, k) logarithms.
        drawn: (n,) minus twice the log of their density but for a constant.
        equations: Of the columns at each.
    """

    logs: Array
    drawn: Array
    equations: list[Equations]

    @classmethod
    def place(cls, posterior: SigmaPosterior, is_quick: bool = False) -> _Nodes:
        """Nodes of a posterior: the most likely one where sigmas are known, drawn ones where they are hardly so."""
        variances, model = np.diag(posterior.covariance), posterior.model
        if np.sqrt(variances).max(initial=0.0) < (_NEARLY_KNOWN if is_quick else _KNOWN_SIGMA):
            logs, drawn = posterior.logs[None], np.zeros(1)
        elif variances.max() > _NEARLY_NORMAL**2 and model.layout.blocks <= _FEW_STOPS and not is_quick:
            logs, drawn = _draw_nodes(posterior)
        else:
            logs, drawn = _cubature(posterior, is_quick)
        return cls(logs, drawn, node_equations(model, logs))


def _cubature(posterior: SigmaPosterior, is_quick: bool = False) -> tuple[Array, Array]:
    """Nodes, (2 r, k), and minus twice the log of their density but for a constant, (2 r,).

    They are along all directions of the logarithms, quickly along those that are not nearly known.
    """
    root = _root(posterior.covariance)
    if is_quick:
        wide = scaled_spectrum(posterior.covariance, _NEARLY_KNOWN**2)
        root = wide.root[:, wide.held].T
    steps = np.sqrt(len(root)) * root
    return posterior.logs + np.concatenate([steps, -steps]), np.zeros(2 * len(root))


def _draw_nodes(posterior: SigmaPosterior) -> tuple[Array, Array]:
    """Nodes drawn by Student's t about the most likely sigmas, in pairs to either side, always equal."""
    rng, k = np.random.default_rng(_SEED), len(posterior.logs)
    normal = rng.standard_normal((_PAIRS, k))
    steps = normal * np.sqrt(_TAILS / rng.chisquare(_TAILS, _PAIRS))[:, None]
    steps = np.concatenate([steps, -steps])
    density = (_TAILS + k) * np.log1p(np.sum(steps**2, -1) / _TAILS)
    nodes = posterior.logs + _WIDER * steps @ _root(posterior.covariance)
    return np.clip(nodes, *_bounds(posterior.model, posterior.prior)), density


def _root(covariance: Array) -> Array:
    """A matrix whose rows' outer products add up to a covariance, (k, k).

    If residuals are zero to the last bit, the variances of the sigmas differ so much that rounding makes the covariance
    indefinite. The root is then taken by eigenvalues, without those that are rounding.
    """
    try:
        return np.asarray(np.linalg.cholesky(covariance).T)
    except np.linalg.LinAlgError:
        return spectrum(covariance).root.T


class Secant(NamedTuple):
    """A step, (k,), and the change of the slope over it, (k,)."""

    step: Array
    change: Array


def correct_curvature(curvature: Array, secants: Sequence[Secant]) -> Array:
    """The curvature, (k, k) positive definite, that has the slope change as it did, as far as it stays regular.

    The average information equals the observed one to within the scatter of the data. If errors of two robots have
    nearly the same effect, it is off by up to a factor of two. Steps by it alone then oscillate. Each pair of a step
    and of the change of the slope over it is a symmetric correction of rank one.
    Source: Broyden 1967; Conn, Gould & Toint 1991 (when to leave one out).
    """
    for step, change in secants:
        off = change - curvature @ step
        along = float(off @ step)
        if abs(along) <= _PARALLEL * float(np.linalg.norm(off) * np.linalg.norm(step)):
            continue
        left = 1 + floored_spectrum(curvature, _REGULAR).squared_mahalanobis(off) / along
        if left > _LEAST_LEFT:
            curvature = curvature + np.outer(off, off) / along
    return curvature
