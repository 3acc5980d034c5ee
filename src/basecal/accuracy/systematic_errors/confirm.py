"""Confirm a systematic error on held-out blocks of the recording.

Blocks of time and of configuration are held out, not random samples: neighbouring samples share errors, and would
predict each other too well. All quantities are of second order about the solution, as the errors are small.
Source: docs/mathematics.md (11.3).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from basecal.accuracy.cross_validation.folds import FOLDS
from basecal.accuracy.systematic_errors.place_scatter import flange_poses
from basecal.accuracy.systematic_errors.score_tests import Linearised, Sums, score_from_sums, view_sums, weigh_views
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.effects.faces.candidates import Candidates
from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.spectral import principal_axes


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Null models without one block of a recording each; the blocks are of time and of configuration.

    Attributes:
        situation: The solved problem.
        model: The null model.
    """

    situation: Situation
    model: Linearised

    @cached_property
    def folds(self) -> tuple[tuple[Fold, ...], ...]:
        """Folds by blocks of time, and folds by blocks of configuration."""
        both = _time_blocks(self.situation), _configuration_blocks(self.situation)
        return tuple(tuple(self._fold(blocks == block) for block in np.unique(blocks)) for blocks in both)

    def confirms(self, candidate: Candidates) -> bool:
        """Whether an error improves the prediction of held-out blocks, both of time and of configuration."""
        return all(sum(_gain(fold, candidate) for fold in folds) > 0 for folds in self.folds)

    def _fold(self, is_held_out: BoolArray) -> Fold:
        """Return the model without the held-out samples, and the model of these alone; the mask is (n,)."""
        outside = [is_held_out[self.situation.sample_indices(group)] for group in self.situation.problem.groups]
        used, held_out = ([np.where(h, *counts) for h in outside] for counts in ((0.0, 1.0), (1.0, 0.0)))
        return Fold(weigh_views(self.model, used), weigh_views(self.model, held_out))


class Fold(NamedTuple):
    """A null model of the used samples, and one of the samples that are held out."""

    used: Linearised
    held_out: Linearised


def _gain(fold: Fold, candidate: Candidates) -> float:
    """Decrease of minus twice the log likelihood of held-out samples by including one error."""
    used, held_out = fold
    of_used, of_held_out = view_sums(used, candidate), view_sums(held_out, candidate)
    size = score_from_sums(used, of_used).size[0]
    without = _cost(held_out, of_held_out, -used.step, np.zeros(len(size)))
    return without - _cost(held_out, of_held_out, -used.step - used.inverse @ (of_used.across[0].T @ size), size)


def _cost(views: Linearised, sums_of_views: Sums, step: Array, size: Array) -> float:
    """Minus twice the log likelihood of views after a step of unknowns and sizes, up to a constant."""
    gradient, across, information = (each[0] for each in sums_of_views)
    of_step = 2 * views.gradient @ step + step @ views.hessian @ step
    return float(of_step + 2 * gradient @ size + 2 * size @ across @ step + size @ information @ size)


def _time_blocks(situation: Situation) -> IntArray:
    count = len(situation.samples)
    return np.arange(count) * FOLDS // count


def _configuration_blocks(situation: Situation) -> IntArray:
    """Block index of each sample along the first principal axis of the flange positions, (samples,)."""
    places = flange_poses(situation)[..., :3].reshape(len(situation.samples), -1)
    centred = places - places.mean(0)
    along = centred @ principal_axes(centred).axes[:, 0] if places.size else np.zeros(len(places))
    blocks = np.empty(len(places), dtype=np.int64)
    blocks[np.argsort(along, kind="stable")] = _time_blocks(situation)
    return blocks
