"""A mixed model of random numbers, and the same model as one dense matrix and vector of all unknowns and errors.

It has three unknowns. Errors of two stops of one robot are in blocks, and those of a stop of the other, with shared
errors, among the columns. A row of the first block is jitter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.effects.faces.shared_errors import SharedErrors
from basecal.estimation.noise.layout import Layout
from basecal.estimation.noise.mixed_model import MixedModel, Moments
from basecal.estimation.noise.sigma_places import SigmaPlaces
from basecal.estimation.noise.view_estimates import STATED
from basecal.geometry import Array

OPEN = (("left", "pose_m"), ("right", "pixel_px"))
ALL_STATED = ("left", STATED)
UNKNOWNS, COLUMNS, BLOCKS, ROWS = 3, 11, 2, 7


@dataclass(frozen=True, eq=False)
class Part:
    """Residuals (n,) with one sigma, at unit sigma, and their derivatives to columns and to errors in blocks."""

    residual: Array
    column_jacobian: Array
    error_jacobian: Array

    @property
    def both(self) -> Array:
        """Derivatives (n, m + b q) to columns, then to errors in blocks."""
        return np.concatenate([self.column_jacobian, self.error_jacobian], -1)

    def moments(self) -> Moments:
        """Moments as the model holds them, without terms between two blocks."""
        z = self.error_jacobian.reshape(-1, BLOCKS, ROWS)
        return Moments(
            float(len(self.residual)),
            float(self.residual @ self.residual),
            self.column_jacobian.T @ self.residual,
            np.einsum("nbq,n->bq", z, self.residual),
            self.column_jacobian.T @ self.column_jacobian,
            np.einsum("nbq,nm->bqm", z, self.column_jacobian),
            np.einsum("nbq,nbr->bqr", z, z),
        )


def part(rng: np.random.Generator, count: int) -> Part:
    """Draw `count` residuals, each of which depends on one block only."""
    error_jacobian = rng.standard_normal((count, BLOCKS, ROWS))
    error_jacobian[np.arange(count), np.arange(count) % BLOCKS] = 0.0
    return Part(rng.standard_normal(count), rng.standard_normal((count, COLUMNS)), error_jacobian.reshape(count, -1))


def made_up(
    rng: np.random.Generator, keys: Sequence[tuple[str, str]] = (*OPEN, ALL_STATED)
) -> tuple[MixedModel, dict[tuple[str, str], Part]]:
    """Draw a model, and return it with the residuals of each part."""
    parts = {key: part(rng, count) for key, count in zip(keys, (40, 30, 25), strict=False)}
    prior = np.eye(COLUMNS)
    root = rng.standard_normal((2, 2))
    prior[:UNKNOWNS, :UNKNOWNS] = 0.0
    prior[:2, :2] = root @ root.T
    gradient = np.concatenate([rng.standard_normal(2), np.zeros(COLUMNS - 2)])
    shared = {"hand": (9, SharedErrors(rng.standard_normal((2, 6, 2)), np.array([False, True])))}
    layout = Layout(
        np.array([0, -1, 1]), np.array([0, -1, 0]), np.array([-1, 3, -1]), np.full(BLOCKS, ROWS), COLUMNS,
        (shared,), {}, (),
    )  # fmt: skip
    open_views = [key for key in OPEN if key in parts]
    sigmas, first = SigmaPlaces.sequential(open_views, ("eye", "hand"), ("left",), 1), len(open_views)
    eye_sigmas, hand_sigmas = first + np.repeat([0, 1], 3), first + np.repeat([2, 3], 3)
    error_sigmas = np.array([[*eye_sigmas, first + 4], [*hand_sigmas, -1]])
    column_sigmas = np.array([-1] * UNKNOWNS + [*hand_sigmas, first + 7, first + 8])
    model = MixedModel(
        {key: each.moments() for key, each in parts.items()}, UNKNOWNS, prior, gradient, 0.7, sigmas, column_sigmas,
        error_sigmas, {}, layout, ("eye", "hand", "hand"),
    )  # fmt: skip
    return model, parts


@dataclass(frozen=True, eq=False)
class DenseModel:
    """The normal equations at given sigmas in full: columns first, then errors of the blocks.

    Attributes:
        scales: Sigma of each unknown.
        information: Of the unknowns in units of their sigmas.
        gradient: In the same units.
        value: Minus twice the log of the restricted likelihood.
        weights: Weight of each part.
    """

    scales: Array
    information: Array
    gradient: Array
    value: float
    weights: dict[tuple[str, str], float]

    @property
    def covariance(self) -> Array:
        return np.linalg.inv(self.information)

    @property
    def mean(self) -> Array:
        return -self.covariance @ self.gradient


def expand_model(model: MixedModel, parts: dict[tuple[str, str], Part], sigmas: Array) -> DenseModel:
    """Build the dense model at sigmas (k,): of open parts, robots' positions and rotations, jitter, shared errors."""
    keys = [key for key in OPEN if key in parts]
    weights = {key: sigmas[keys.index(key)] ** -2.0 if key in keys else 1.0 for key in parts}
    scales = np.append(sigmas, 1.0)[np.concatenate([model.of_columns, model.of_errors.ravel()])]
    count = len(scales)
    information, gradient = np.eye(count), np.zeros(count)
    information[:COLUMNS, :COLUMNS], gradient[:COLUMNS] = model.prior, model.prior_gradient
    value = model.prior_cost
    for key, each in parts.items():
        scaled = each.both * scales
        information += weights[key] * scaled.T @ scaled
        gradient += weights[key] * scaled.T @ each.residual
        value += weights[key] * each.residual @ each.residual
        value += 2 * len(each.residual) * np.log(sigmas[keys.index(key)]) if key in keys else 0.0
    value += np.linalg.slogdet(information)[1] - gradient @ np.linalg.solve(information, gradient)
    return DenseModel(scales, information, gradient, value, weights)
