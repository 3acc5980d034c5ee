"""Errors that stops of a scene share: their estimates from pixels, and their effect on the answer.

Errors of stops are unknowns of their own. Errors that stops share are evaluated about the optimum. g is the gradient to
them, S their information once all else follows, and F their effect on the other columns. An error of mean zero and
variance V moves the answer by F (S + V^-1)^-1 g. A descent ends near an optimum, and what is left of the other columns'
gradient is taken from g. An error that they take up then has none. Sources: Rao 1948 (scores); Neyman 1959.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from basecal.effects import smooth_by_place
from basecal.effects.faces.effect import SigmaPrior
from basecal.effects.length_scale import LENGTHS, outward
from basecal.estimation.scene.adjust import SceneFit
from basecal.geometry import SE3, Array, IntArray

_NODES = np.arange(-2.0, 3.0)  # of the logarithm of a sigma, in standard deviations


class Response(NamedTuple):
    """The response of pixels to k errors that stops share.

    Attributes:
        gradient: (k,).
        information: (k, k) once all else follows.
        moves: (q, k) of all columns that are no errors of stops.
    """

    gradient: Array
    information: Array
    moves: Array

    def posterior(self, variance: Array) -> tuple[Array, Array]:
        """Mean (k,) and covariance (k, k) of the errors, of which variances (k,) are expected."""
        spread = np.linalg.inv(self.information + np.diag(1 / variance))
        return np.asarray(-spread @ self.gradient), np.asarray(spread)

    def log_evidence(self, variance: Array) -> float:
        """Log evidence of these variances, over that of none."""
        mean, _ = self.posterior(variance)
        grown = np.eye(len(variance)) + self.information * variance
        return float(-0.5 * self.gradient @ mean - 0.5 * np.linalg.slogdet(grown)[1])


def respond(fit: SceneFit, by_stop: Array) -> Response:
    """The response to errors by which flanges move so, (s, 6, k), right tangents of each stop."""
    errors = fit.columns.errors
    moves = by_stop.reshape(-1, by_stop.shape[-1])
    across = fit.pixel_information[:, errors] @ moves / fit.sigma_px**2
    follows = np.linalg.solve(fit.information, across)
    information = moves.T @ across[errors] - across.T @ follows
    gradient = moves.T @ fit.pixel_gradient[errors] / fit.sigma_px**2 - follows.T @ fit.gradient
    return Response(gradient, np.asarray((information + information.T) / 2), np.asarray(-follows[: errors.start]))


class SharedError(NamedTuple):
    """k errors that a robot's stops share, as likely as the pixels have them.

    Attributes:
        moves: (q, k) of all columns that are no errors of stops.
        moment: (k, k) their second moment.
        at: How flanges at poses, (n,), move with them, (n, 6, k), right tangents.
        unseen_m2: Variance along an axis at poses, (n,), that no recorded pose has, (n,) [m^2].
    """

    moves: Array
    moment: Array
    at: Callable[[SE3], Array]
    unseen_m2: Callable[[SE3], Array]


def shared_errors(fit: SceneFit, robot: int) -> list[SharedError]:
    """Errors that a robot's stops share: of its lengths, and smooth ones."""
    mine = np.flatnonzero(fit.views.robot == robot)
    recorded = fit.views.base_from_flange[mine]
    response = respond(fit, _move_stops(fit, mine, outward(recorded)))
    moment, _ = _second_moment(response, SigmaPrior.single_value(LENGTHS.sigma))
    lengths = SharedError(response.moves, moment, outward, lambda poses: np.zeros(len(poses)))
    smooth = smooth_by_place.errors(recorded, recorded)
    if smooth is None:
        return [lengths]
    assert smooth_by_place.EFFECT.random is not None
    middle, factor = smooth_by_place.EFFECT.random.expected.turn
    reach_m = float(np.sqrt(np.mean(np.sum(recorded.translation**2, 1))))
    lever = np.where(smooth.is_turn, 1.0, reach_m)

    def flange_moves(poses: SE3) -> Array:
        """How flanges at poses move, (n, 6, k)."""
        found = smooth_by_place.errors(recorded, poses)
        assert found is not None
        return found.by_stop * lever

    response = respond(fit, _move_stops(fit, mine, flange_moves(recorded)))
    moment, variance = _second_moment(response, SigmaPrior.as_often_as_not(middle * factor**_NODES))

    def unseen_m2(poses: SE3) -> Array:
        """Variance that modes of recorded poses leave, (n,) [m^2]."""
        known_m2 = np.sum(flange_moves(poses)[:, :3] ** 2, axis=(1, 2)) / 3
        return np.asarray(variance * np.maximum(reach_m**2 - known_m2, 0.0))

    return [lengths, SharedError(response.moves, moment, flange_moves, unseen_m2)]


def shared_covariance(fit: SceneFit, robot: int) -> Array:
    """Covariance of all columns but stops' errors by what a robot's stops share."""
    return np.asarray(sum(each.moves @ each.moment @ each.moves.T for each in shared_errors(fit, robot)))


def _move_stops(fit: SceneFit, views: IntArray, moves: Array) -> Array:
    """How each stop moves by what the stops of some views share, (n, 6, k) to (s, 6, k)."""
    found = np.zeros((len(fit.stop_sigma), *moves.shape[1:]))
    found[fit.views.stop[views]] = moves
    return found


def _second_moment(response: Response, prior: SigmaPrior) -> tuple[Array, float]:
    """Second moment of errors of one sigma, as likely as the data have it, (k, k), and mean square of that sigma."""
    count = len(response.gradient)
    variances = [np.full(count, sigma**2) for sigma in prior.sigmas if sigma]
    likely = np.exp([response.log_evidence(each) for each in variances])
    of_none = float(prior.shares[prior.sigmas == 0].sum())
    share = prior.shares[prior.sigmas > 0] * likely / (of_none + prior.shares[prior.sigmas > 0] @ likely)
    moment = sum(
        weight * (covariance + np.outer(mean, mean))
        for weight, (mean, covariance) in zip(share, map(response.posterior, variances), strict=True)
    )
    return moment, float(share @ prior.sigmas[prior.sigmas > 0] ** 2)


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
    """The motion that is most likely, whether there was one or not, by its score at the optimum without any.

    A motion of the scene moves cameras about it as errors of stops do, but in time. With the gradient g to it and its
    information S, g' S^-1 g is chi-square with six freedoms if nothing moved.
    """
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
