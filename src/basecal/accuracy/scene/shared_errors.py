"""Errors that stops of a scene share: their estimates from pixels, and their effect on the solution.

Errors of single stops are separate unknowns. Errors that stops share are evaluated about the optimum. Let g be the
gradient with respect to shared errors. S is their information with all other columns eliminated, and F their effect on
these columns. An error of mean zero and variance V moves the solution by F (S + V^-1)^-1 g. A descent ends near an
optimum, so g is corrected for the remaining gradient of the other columns. The gradient of an error that the other
columns absorb is then zero. Sources: Rao 1948 (scores); Neyman 1959.
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
from basecal.numerics.mixtures import probabilities

_NODES = np.arange(-2.0, 3.0)  # of the logarithm of a sigma, in standard deviations


class Response(NamedTuple):
    """The response of pixels to k errors that stops share.

    Attributes:
        gradient: (k,) gradient with respect to the errors, corrected for that of the other columns.
        information: (k, k) information about the errors, all other columns eliminated.
        moves: (q, k) derivative of all columns except stop errors.
    """

    gradient: Array
    information: Array
    moves: Array

    def posterior(self, variance: Array) -> tuple[Array, Array]:
        """Mean (k,) and covariance (k, k) of the errors, given their prior variances (k,)."""
        spread = np.linalg.inv(self.information + np.diag(1 / variance))
        return np.asarray(-spread @ self.gradient), np.asarray(spread)

    def log_evidence(self, variance: Array) -> float:
        """Log evidence of prior variances (k,) relative to no shared errors."""
        mean, _ = self.posterior(variance)
        grown = np.eye(len(variance)) + self.information * variance
        return float(-0.5 * self.gradient @ mean - 0.5 * np.linalg.slogdet(grown)[1])


def compute_response(fit: SceneFit, by_stop: Array) -> Response:
    """Return the response to k errors that move the flange at each stop by right tangents `by_stop`, (s, 6, k)."""
    errors = fit.columns.errors
    moves = by_stop.reshape(-1, by_stop.shape[-1])
    across = fit.pixel_information[:, errors] @ moves / fit.sigma_px**2
    follows = np.linalg.solve(fit.information, across)
    information = moves.T @ across[errors] - across.T @ follows
    gradient = moves.T @ fit.pixel_gradient[errors] / fit.sigma_px**2 - follows.T @ fit.gradient
    return Response(gradient, np.asarray((information + information.T) / 2), np.asarray(-follows[: errors.start]))


class SharedError(NamedTuple):
    """k errors that a robot's stops share, with their posterior given the pixels.

    Attributes:
        moves: (q, k) derivative of all columns except stop errors.
        moment: (k, k) posterior second moment of the errors.
        flange_jacobian: Function of poses, (n,): derivative of the flange with respect to the errors, (n, 6, k), right
            tangents.
        unseen_m2: Function of poses, (n,): variance along an axis that no recorded pose shows, (n,) [m^2].
    """

    moves: Array
    moment: Array
    flange_jacobian: Callable[[SE3], Array]
    unseen_m2: Callable[[SE3], Array]


def shared_errors(fit: SceneFit, robot: int) -> list[SharedError]:
    """Errors that a robot's stops share: a length error, and errors that vary smoothly with the pose."""
    mine = np.flatnonzero(fit.views.robot == robot)
    recorded = fit.views.base_from_flange[mine]
    response = compute_response(fit, _move_stops(fit, mine, outward(recorded)))
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
        """Derivative of flanges at poses with respect to the smooth errors, (n, 6, k)."""
        found = smooth_by_place.errors(recorded, poses)
        assert found is not None
        return found.by_stop * lever

    response = compute_response(fit, _move_stops(fit, mine, flange_moves(recorded)))
    moment, variance = _second_moment(response, SigmaPrior.spike_and_slab(middle * factor**_NODES))

    def unseen_m2(poses: SE3) -> Array:
        """Variance at poses that the modes of recorded poses do not cover, (n,) [m^2]."""
        known_m2 = np.sum(flange_moves(poses)[:, :3] ** 2, axis=(1, 2)) / 3
        return np.asarray(variance * np.maximum(reach_m**2 - known_m2, 0.0))

    return [lengths, SharedError(response.moves, moment, flange_moves, unseen_m2)]


def shared_covariance(fit: SceneFit, robot: int) -> Array:
    """Covariance of all columns except stop errors from a robot's shared errors, (q, q)."""
    return np.asarray(sum(each.moves @ each.moment @ each.moves.T for each in shared_errors(fit, robot)))


def _move_stops(fit: SceneFit, views: IntArray, moves: Array) -> Array:
    """Assign derivatives of views, (n, 6, k), to the stops of these views, (s, 6, k)."""
    found = np.zeros((len(fit.stop_sigma), *moves.shape[1:]))
    found[fit.views.stop[views]] = moves
    return found


def _second_moment(response: Response, prior: SigmaPrior) -> tuple[Array, float]:
    """Posterior second moment of errors with a common sigma, (k, k), and posterior mean of the squared sigma."""
    variances = [np.full(len(response.gradient), sigma**2) for sigma in prior.sigmas]
    evidence = np.array([response.log_evidence(each) if each.all() else 0.0 for each in variances])
    shares = probabilities(prior.probabilities, 2 * evidence)
    moment = np.zeros_like(response.information)
    for share, variance in zip(shares, variances, strict=True):
        if variance.all():
            mean, covariance = response.posterior(variance)
            moment += share * (covariance + np.outer(mean, mean))
    return moment, float(shares @ prior.sigmas**2)


# [m, rad] prior sigma of a motion; regularises directions that bases absorb; assumed.
_MOTION_SIGMA = np.full(6, 0.1)
_FEWEST_BESIDE = 3  # samples before and after a sudden motion: two may have independent errors; assumed


class SceneMotion(NamedTuple):
    """The most likely motion of a scene.

    Attributes:
        chance: p-value of the score, for all tried motions, if nothing moved.
        first_sample: First sample after a sudden motion; None if the motion is steady.
        length_m: Distance that the middle of the points moves [m].
        step: (q,) shift of all columns except stop errors.
    """

    chance: float
    first_sample: int | None
    length_m: float
    step: Array


def scene_motion(fit: SceneFit) -> SceneMotion:
    """Return the most likely motion by its score at the optimum without motion, even if it is not significant.

    A motion of the scene acts like stop errors that change with time. Let g be the gradient with respect to the motion
    and S its information. Then g' S^-1 g is chi-square with six degrees of freedom if nothing moved.
    """
    tried = [(each, _score(fit, profile)) for each, profile in _profiles(fit)]
    first_sample, (score, motion, step) = max(tried, key=lambda each: each[1][0])
    chance = min(1.0, len(tried) * float(chdtrc(6, score)))
    return SceneMotion(chance, first_sample, float(np.linalg.norm(motion[:3])), step)


def _profiles(fit: SceneFit) -> Iterator[tuple[int | None, Array]]:
    """Yield profiles of motions, from 0 to 1, (s,): a steady one, and a step before each sample.

    Each profile comes with the number of the first sample after the step; None for the steady motion.
    """
    count = len(fit.stop_sigma)
    sample = np.zeros(count, dtype=np.int64)
    carried = fit.views.robot >= 0
    sample[fit.views.stop[carried]] = fit.views.sample[carried]
    numbers, rank = np.unique(sample, return_inverse=True)
    yield None, rank / max(len(numbers) - 1, 1)
    for k in range(_FEWEST_BESIDE, len(numbers) - _FEWEST_BESIDE + 1):
        yield int(numbers[k]), (rank >= k).astype(float)


def _score(fit: SceneFit, profile: Array) -> tuple[float, Array, Array]:
    """Score of a motion, its size about the middle of the points, (6,) [m, rad], and its shift of columns, (q,)."""
    response = compute_response(fit, profile[:, None, None] * _flange_moves(fit))
    motion, _ = response.posterior(_MOTION_SIGMA**2)
    return float(-response.gradient @ motion), motion, response.moves @ motion


def _flange_moves(fit: SceneFit) -> Array:
    """Derivative of each stop's flange with respect to a motion of the scene about its middle point, (s, 6, 6)."""
    views, moves = fit.views, np.zeros((len(fit.stop_sigma), 6, 6))
    middle = SE3(np.eye(3), np.median(fit.state.points, axis=0))
    flange_from_middle = fit.state.world_from_flange(views).inverse() @ middle
    carried = np.flatnonzero(views.robot >= 0)
    moves[views.stop[carried]] = -flange_from_middle.adjoint()[carried]
    return moves
