"""The variance of a frame from place to place over that of noise, which a change in time has to exceed.

A recording goes from place to place as time passes. Some errors by place or posture have no model here: those of gears,
of points on a body, of arms that lean on one another. A split of the recording in time shows them. So do splits by
place, beside the change: their mean chi-square over its freedoms is the variance that the change is compared with.
Source: analysis of variance, Fisher 1925; its freedoms, Satterthwaite 1946; docs/mathematics.md (11.6).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from basecal.accuracy.model_comparison.nested_models import log_chance
from basecal.accuracy.systematic_errors.score_tests import HIDDEN, Linearised, score, with_random_effects
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.effects.faces.candidates import Candidates, frame_candidates
from basecal.estimation.problem.gauges import LENGTH_M
from basecal.geometry import Array, BoolArray
from basecal.numerics.spectral import principal_axes, spectrum

_SHARES = (1 / 3, 2 / 3)  # of the samples on one side of a split
_MOST_AXES = 12  # as two arms have freedoms, which bounds the time


class PlaceScatter(NamedTuple):
    """A variance over that of noise, and by how many freedoms it is known; 1 and infinitely many of noise alone."""

    ratio: float = 1.0
    freedoms: float = np.inf

    def log_chance(self, statistic: float, freedoms: int) -> float:
        """Logarithm of the chance that a change scores so much if it is none."""
        return log_chance(statistic / self.ratio, freedoms, self.freedoms)


def place_scatter(situation: Situation, null: Linearised, change: Candidates) -> PlaceScatter:
    """How a frame differs by place, beside one change of it in time.

    Args:
        situation: The solved problem.
        null: Its null model.
        change: A change of one frame.
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
    """The root that makes gradients of splits, (q,), independent and of unit variance within each, (q, q)."""
    width = len(information) // count
    own = [information[k : k + width, k : k + width] for k in range(0, len(information), width)]
    return np.asarray(block_diag(*spectrum(np.array(own), HIDDEN).inverse_root))


def _place_splits(situation: Situation, name: str) -> BoolArray:
    """Whether samples are beyond each of some planes across the poses of all flanges, (samples, splits)."""
    groups = situation.groups
    seen = np.unique(np.concatenate([situation.rank(g) for k, g in enumerate(groups) if situation.depends(k, name)]))
    poses = flange_poses(situation).reshape(len(situation.samples), -1)
    centred = poses - poses[seen].mean(0)
    axes = principal_axes(centred[seen])
    along = centred @ axes.axes[:, : min(axes.dimension, _MOST_AXES)]
    return np.asarray((along[:, None] > np.quantile(along[seen], _SHARES, axis=0)).reshape(len(along), -1))


def flange_poses(situation: Situation) -> Array:
    """Places and axes of all flanges as recorded, (samples, robots, 12) [m]."""
    poses = np.zeros((len(situation.samples), len(situation.robots), 12))
    for i, robot in enumerate(situation.robots):
        for k, group in enumerate(situation.groups):
            if group.robot_end(robot):
                pose = situation.recorded_pose(k, robot)
                rows = pose.translation, LENGTH_M * pose.rotation.reshape(-1, 9)
                poses[situation.rank(group), i] = np.concatenate(rows, axis=1)
    return poses


COST = 0.5
"""Among errors, one of many costs half the logarithm of their number; `benchmarks.false_alarms` judges it."""


@dataclass(frozen=True, eq=False)
class Suspect:
    """An error whose score chance hardly makes.

    Attributes:
        effect: Name of the effect that it is of.
        candidate: It alone.
        size: (q,) to first order.
        freedoms: How many of its sizes the data show.
        statistic: Its chi-square.
        log_chance: Logarithm of the chance that any of its code has such a score.
        screened: The same, or less where stops share no errors, whose sigmas may hold the error itself.
        several: Logarithm of how many these are.
        family: How many codes were tested.
        scatter: What it has to exceed; None if that is noise alone.
    """

    effect: str
    candidate: Candidates
    size: Array
    freedoms: int
    statistic: float
    log_chance: float
    screened: float
    several: float
    family: int = 1
    scatter: PlaceScatter | None = None

    @property
    def rank(self) -> float:
        """Logarithm of its chance among errors of all codes, where no random effect can hold one."""
        return self.screened + COST * self.several

    def log_chance_beside_places(self, gain: float, chance: float) -> float:
        """Logarithm of the chance of its score, or of a larger gain, beside what differs by place.

        Args:
            gain: Of minus twice the log likelihood.
            chance: The logarithm of the chance of both beside noise.
        """
        if self.scatter is None:
            return chance
        return self.scatter.log_chance(max(gain, self.statistic), self.freedoms) + self.several
