"""A mixed model of made-up numbers beside the same written out in full: one matrix, one vector, of all that is unknown.

Three unknowns; two stops of one robot in blocks, one of the other among the columns, with what their errors have in
common; jitter in a row of the first block.
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
    """Residuals that go by one sigma: r (n,) at unit sigma, and their derivatives to columns and all errors."""

    residual: Array
    column_jacobian: Array
    by_errors: Array

    @property
    def both(self) -> Array:
        """(n, m + b q) to columns, then errors in blocks."""
        return np.concatenate([self.column_jacobian, self.by_errors], -1)

    def moments(self) -> Moments:
        """As the model holds them: what ties two blocks is none."""
        z = self.by_errors.reshape(-1, BLOCKS, ROWS)
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
    """Residuals of as many kinds; each is of one block."""
    by_errors = rng.standard_normal((count, BLOCKS, ROWS))
    by_errors[np.arange(count), np.arange(count) % BLOCKS] = 0.0
    return Part(rng.standard_normal(count), rng.standard_normal((count, COLUMNS)), by_errors.reshape(count, -1))


def made_up(
    rng: np.random.Generator, keys: Sequence[tuple[str, str]] = (*OPEN, ALL_STATED)
) -> tuple[MixedModel, dict[tuple[str, str], Part]]:
    """The model, and its parts written out."""
    parts = {key: part(rng, count) for key, count in zip(keys, (40, 30, 25), strict=False)}
    prior = np.eye(COLUMNS)
    root = rng.standard_normal((2, 2))
    prior[:UNKNOWNS, :UNKNOWNS] = 0.0
    prior[:2, :2] = root @ root.T
    gradient = np.concatenate([rng.standard_normal(2), np.zeros(COLUMNS - 2)])
    in_common = {"hand": (9, SharedErrors(rng.standard_normal((2, 6, 2)), np.array([False, True])))}
    layout = Layout(
        np.array([0, -1, 1]), np.array([0, -1, 0]), np.array([-1, 3, -1]), np.full(BLOCKS, ROWS), COLUMNS,
        (in_common,), {}, (),
    )  # fmt: skip
    open_views = [key for key in OPEN if key in parts]
    sigmas, first = SigmaPlaces.sequential(open_views, ("eye", "hand"), ("left",), 1), len(open_views)
    of_eye, of_hand = first + np.repeat([0, 1], 3), first + np.repeat([2, 3], 3)
    of_errors = np.array([[*of_eye, first + 4], [*of_hand, -1]])
    of_columns = np.array([-1] * UNKNOWNS + [*of_hand, first + 7, first + 8])
    model = MixedModel(
        {key: of.moments() for key, of in parts.items()}, UNKNOWNS, prior, gradient, 0.7, sigmas, of_columns, of_errors,
        {}, layout, ("eye", "hand", "hand"),
    )  # fmt: skip
    return model, parts


@dataclass(frozen=True, eq=False)
class Written:
    """All that is unknown at given sigmas, written out: columns first, then errors of the blocks.

    Attributes:
        scales: Sigma of each.
        information: Of what is unknown, in sigmas.
        gradient: Likewise.
        value: Minus twice the log of the restricted likelihood.
        weights: By part.
    """

    scales: Array
    information: Array
    gradient: Array
    value: float
    weights: dict[tuple[str, str], float]

    @property
    def covariance(self) -> Array:
        """Of all."""
        return np.linalg.inv(self.information)

    @property
    def mean(self) -> Array:
        """Of all."""
        return -self.covariance @ self.gradient


def written(model: MixedModel, parts: dict[tuple[str, str], Part], sigmas: Array) -> Written:
    """At sigmas (k,): of open parts, robots' shifts and turns, jitter, errors in common."""
    keys = [key for key in OPEN if key in parts]
    weights = {key: sigmas[keys.index(key)] ** -2.0 if key in keys else 1.0 for key in parts}
    scales = np.append(sigmas, 1.0)[np.concatenate([model.of_columns, model.of_errors.ravel()])]
    count = len(scales)
    information, gradient = np.eye(count), np.zeros(count)
    information[:COLUMNS, :COLUMNS], gradient[:COLUMNS] = model.prior, model.prior_gradient
    value = model.prior_cost
    for key, of in parts.items():
        scaled = of.both * scales
        information += weights[key] * scaled.T @ scaled
        gradient += weights[key] * scaled.T @ of.residual
        value += weights[key] * of.residual @ of.residual
        value += 2 * len(of.residual) * np.log(sigmas[keys.index(key)]) if key in keys else 0.0
    value += np.linalg.slogdet(information)[1] - gradient @ np.linalg.solve(information, gradient)
    return Written(scales, information, gradient, value, weights)
