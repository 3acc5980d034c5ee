"""Whether a scene moved while it was seen: scores of motions in time, at the optimum without any.

A motion of the scene moves cameras about it as errors of stops do, but in time. With the gradient g to it and its
information S (`shared_errors`), g' S^-1 g is chi-square with six freedoms if nothing moved.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from basecal.accuracy.scene.shared_errors import respond
from basecal.estimation.scene.adjust import SceneFit
from basecal.geometry import SE3, Array

# [m, rad] sigma of motions that are tried; keeps what bases take up regular; assumed.
_LARGEST = np.repeat([0.1, 0.1], 3)
_FEWEST_BESIDE = 3  # stops before and after a sudden motion: two may each be wrong for themselves; assumed


class SceneMotion(NamedTuple):
    """The most likely motion of a scene.

    Attributes:
        chance: Of so large a score of any motion that was tried, if nothing moved.
        first_sample: From which on it is elsewhere; None if it moves steadily.
        length_m: How far the middle of its points moves [m].
        step: (q,) what it moves all columns by that are no errors of stops.
    """

    chance: float
    first_sample: int | None
    length_m: float
    step: Array


def scene_motion(fit: SceneFit) -> SceneMotion:
    """The motion that is most likely, whether there was one or not."""
    tried = [(each, _score(fit, profile)) for each, profile in _profiles(fit)]
    first_sample, (score, motion, step) = max(tried, key=lambda each: each[1][0])
    chance = min(1.0, len(tried) * float(chdtrc(6, score)))
    return SceneMotion(chance, first_sample, float(np.linalg.norm(motion[:3])), step)


def _profiles(fit: SceneFit) -> Iterator[tuple[int | None, Array]]:
    """How far a motion is at each stop, 1 in all: steadily, or at once before a sample, which is named."""
    count = len(fit.stop_sigma)
    sample = np.zeros(count, dtype=np.int64)
    carried = fit.views.robot >= 0
    sample[fit.views.stop[carried]] = fit.views.sample[carried]
    numbers, rank = np.unique(sample, return_inverse=True)
    yield None, rank / max(len(numbers) - 1, 1)
    for k in range(_FEWEST_BESIDE, len(numbers) - _FEWEST_BESIDE + 1):
        yield int(numbers[k]), (rank >= k).astype(float)


def _score(fit: SceneFit, profile: Array) -> tuple[float, Array, Array]:
    """The score of a motion by a profile, its size about the middle of the points, and what it moves columns by."""
    response = respond(fit, profile[:, None, None] * _flange_moves(fit))
    motion, _ = response.posterior(_LARGEST**2)
    return float(-response.gradient @ motion), motion, response.moves @ motion


def _flange_moves(fit: SceneFit) -> Array:
    """Right tangents of each stop's flange that are one of the scene about the middle of its points, (s, 6, 6)."""
    views, moves = fit.views, np.zeros((len(fit.stop_sigma), 6, 6))
    middle = SE3(np.eye(3), np.median(fit.state.points, axis=0))
    flange_from_middle = fit.state.world_from_flange(views).inverse() @ middle
    carried = np.flatnonzero(views.robot >= 0)
    moves[views.stop[carried]] = -flange_from_middle.adjoint()[carried]
    return moves
