"""Variance of a frame between places relative to noise, which a change in time has to exceed.

During a recording the robots move from place to place. Some errors by place or posture have no model here: those of
gears, of points on a body, of arms that lean on each other. A split of the recording in time shows them. Splits by
place show them, too, even with the change in the model. The mean chi-square of these splits per degree of freedom is
the variance with which the change is compared.
Source: analysis of variance, Fisher 1925; degrees of freedom, Satterthwaite 1946; docs/mathematics.md (11.6).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from basecal.accuracy.model_comparison.nested_models import log_chance
from basecal.accuracy.systematic_errors.score_tests import HIDDEN_SHARE, Linearised, score, with_random_effects
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.effects.faces.candidates import Candidates, frame_candidates
from basecal.estimation.problem.gauges import LENGTH_M
from basecal.geometry import Array, BoolArray
from basecal.numerics.spectral import principal_axes, spectrum

_SHARES = (1 / 3, 2 / 3)  # of the samples on one side of a split
_MOST_AXES = 12  # degrees of freedom of two flanges; bounds the time


class PlaceScatter(NamedTuple):
    """A variance relative to noise, and its degrees of freedom; 1 and infinite for noise alone."""

    ratio: float = 1.0
    freedoms: float = np.inf

    def log_chance(self, statistic: float, freedoms: int) -> float:
        """Log p-value of a change's score, relative to the scatter by place."""
        return log_chance(statistic / self.ratio, freedoms, self.freedoms)


def place_scatter(situation: Situation, null: Linearised, change: Candidates) -> PlaceScatter:
    """Estimate the scatter of a frame by place, with one change of the frame in time included in the model.

    Args:
        situation: The solved problem.
        null: The null model of the problem.
        change: A change of one frame in time.
    """
    is_beyond = _place_splits(situation, change.about[0])
    if not is_beyond.size:
        return PlaceScatter()
    splits = frame_candidates("base-moved", situation, change.about[0], is_beyond, (None,) * is_beyond.shape[1])
    beside = with_random_effects(null, tuple(None if moves is None else moves[:, 0] for moves in change.moves))
    found = score(beside, splits.join_sizes())
    root = _whitening_root(found.information[0], len(splits.about))
    scores, correlation = root.T @ found.gradient[0], root.T @ found.information[0] @ root
    total = float(np.trace(correlation))
    if total < 1:
        return PlaceScatter()
    return PlaceScatter(max(1.0, float(scores @ scores) / total), total**2 / float(np.sum(correlation**2)))


def _whitening_root(information: Array, count: int) -> Array:
    """Matrix that whitens the gradients of `count` splits, each within itself, (q, q)."""
    width = len(information) // count
    own = [information[k : k + width, k : k + width] for k in range(0, len(information), width)]
    return np.asarray(block_diag(*spectrum(np.array(own), HIDDEN_SHARE).inverse_root))


def _place_splits(situation: Situation, name: str) -> BoolArray:
    """Mask of the samples on the far side of planes that split the poses of all flanges, (samples, splits)."""
    groups = situation.groups
    seen = np.unique(
        np.concatenate([situation.sample_indices(g) for k, g in enumerate(groups) if situation.depends(k, name)])
    )
    poses = flange_poses(situation).reshape(len(situation.samples), -1)
    centred = poses - poses[seen].mean(0)
    axes = principal_axes(centred[seen])
    along = centred @ axes.axes[:, : min(axes.dimension, _MOST_AXES)]
    return np.asarray((along[:, None] > np.quantile(along[seen], _SHARES, axis=0)).reshape(len(along), -1))


def flange_poses(situation: Situation) -> Array:
    """Recorded positions and scaled rotation matrices of all flanges, (samples, robots, 12) [m]."""
    poses = np.zeros((len(situation.samples), len(situation.robots), 12))
    for i, robot in enumerate(situation.robots):
        for k, group in enumerate(situation.groups):
            if group.robot_end(robot):
                pose = situation.recorded_pose(k, robot)
                rows = pose.translation, LENGTH_M * pose.rotation.reshape(-1, 9)
                poses[situation.sample_indices(group), i] = np.concatenate(rows, axis=1)
    return poses


COUNT_PENALTY = 0.5
"""Penalty of an error among several of its code, per logarithm of their number; `benchmarks.false_alarms` tests it."""


@dataclass(frozen=True, eq=False)
class Suspect:
    """An error whose score has a small p-value.

    Attributes:
        effect: Name of the effect.
        candidate: The single candidate of the error.
        size: (q,) sizes to first order.
        freedoms: Number of sizes that the data determine.
        statistic: Chi-square of the error.
        log_chance: Log p-value of the score, for all candidates of its code.
        single_log_chance: Log p-value of the single score. It is the smaller of those with and without random effects,
            as the sigmas of these may contain the error.
        log_count: Logarithm of the number of candidates of its code.
        family: Number of codes that were tested.
        scatter: The scatter by place that the score has to exceed; None if it is compared with noise alone.
    """

    effect: str
    candidate: Candidates
    size: Array
    freedoms: int
    statistic: float
    log_chance: float
    single_log_chance: float
    log_count: float
    family: int = 1
    scatter: PlaceScatter | None = None

    @property
    def rank(self) -> float:
        """Log p-value with the penalty of several candidates, by which suspects of all codes are ordered."""
        return self.single_log_chance + COUNT_PENALTY * self.log_count

    def log_chance_beside_places(self, gain: float, chance: float) -> float:
        """Log p-value of the larger of score and gain, relative to the scatter by place.

        Args:
            gain: Decrease of minus twice the log likelihood.
            chance: Log p-value relative to noise, which is returned without scatter.
        """
        if self.scatter is None:
            return chance
        return self.scatter.log_chance(max(gain, self.statistic), self.freedoms) + self.log_count
