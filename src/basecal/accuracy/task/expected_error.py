"""How far off points are expected to be that a calibration carries from one frame to another, where the arms worked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import chndtr, chndtrix, gammainc

from basecal.accuracy.residuals.evaluation import Evaluation
from basecal.accuracy.task.task import place_kind, placed_transforms
from basecal.cell import Calibration, Cell, MeetingError, Tolerance
from basecal.geometry import Array
from basecal.geometry.rotation import cross_matrix

QUANTILE_LEVEL = 0.95  # the usual level, which reports name
_NODES = 12  # of either angle, with which quantiles of a covariance of any shape are exact to 1e-6
_LEAST_QUANTILE = 1.95  # of a quantile in the largest sigma: that of a normal number, 1.96, has all others equal to 0
_NEWTON_ROUNDS = 8  # at most: each doubles the digits, of which `_NODES` leave six
_SECANT_ROUNDS = 60  # at most: as many halvings would reach 1e-18 of the interval
_SETTLED_SHARE = 1e-12  # of the probability, by which a quantile is found: far below the 1e-6 of `_NODES`
# [m^2] standard deviation of the square of a length that is certain: rounding of a square metre squared.
_CERTAIN_M2 = 1e-30
_LEAST_SHARE = 1e-8  # of the largest variance: the root of machine precision, below which it is no length


@dataclass(frozen=True, eq=False)
class ExpectedError:
    """The expected error of a transform `a_from_b` at a point, by its covariance.

    Attributes:
        transform: Its name.
        length_m: The distance that the error of a point's position in a stays below in 95 cases of 100 [m].
        at_m: (3,) the point in b [m]: of all places where the arms worked the one that is known least.
    """

    transform: str
    length_m: float
    at_m: Array


def expected_errors(cell: Cell, calibration: Calibration, evaluation: Evaluation) -> tuple[ExpectedError, ...]:
    """The expected error of each requested transform, where it is used most uncertainly.

    A base is used at the recorded flanges of its robot. The mount of a camera is used at its targets, that of a target
    at its points; the robots' own errors come on top.

    Args:
        cell: What was calibrated.
        calibration: What came out.
        evaluation: The recording at its transforms.
    """
    found = []
    for name in cell.requested_transforms:
        if name not in calibration.transforms or not np.all(np.isfinite(calibration[name].covariance)):
            continue
        places = np.concatenate([np.zeros((0, 3)), *_places(name, cell, evaluation)])
        if len(places):
            covariances = point_covariances(calibration[name].covariance, places)
            worst = int(np.argmax(np.trace(covariances, axis1=1, axis2=2)))
            found.append(ExpectedError(name, length_quantile(covariances[worst]), places[worst]))
    return tuple(found)


def check_tolerance(cell: Cell, calibration: Calibration, errors: Sequence[ExpectedError]) -> Tolerance | None:
    """Whether the error at the work is within the tolerance that the settings state; None if they state none.

    It is that where flanges meet, and of what else is requested.
    """
    asked_m = calibration.settings.get("tolerance_m")
    if asked_m is None:
        return None
    lengths, meeting = {each.transform: each.length_m for each in errors}, calibration.meeting
    is_complete = lengths.keys() == set(cell.requested_transforms)
    if meeting is not None:
        lengths = dict.fromkeys(placed_transforms(cell), meeting.expected_95_m) | {
            name: length for name, length in lengths.items() if name not in placed_transforms(cell)
        }
    found = Tolerance(asked_m, max(lengths.values(), default=0.0) if is_complete else None, False)
    return replace(found, met=found.is_within and calibration.verdict == "good")


def pool_errors(covariances: Array, means: Array, task_m: Array) -> MeetingError:
    """The error where flanges meet, by its normals at several places, (n, 3, 3) and (n, 3), those of a task or others.

    Args:
        covariances: [m^2].
        means: [m].
        task_m: (k, 3) the task [m]; (0, 3) without one.
    """
    variance = float(np.mean(np.trace(covariances, axis1=1, axis2=2) + np.sum(means**2, -1)))
    return MeetingError(pooled_quantile(covariances, means), place_kind(task_m), float(np.sqrt(variance / 3)))


def pooled_quantile(covariances: Array, means: Array) -> float:
    """The length that vectors of these normals, (n, 3, 3) and (n, 3), each as often, stay below with `QUANTILE_LEVEL`.

    Each as in `_NonCentral`.
    """
    normals = _non_central(covariances, means)
    own = normals.quantile()
    old, new = float(own.min()), float(own.max())
    before, off = (normals.probability(end).mean() - QUANTILE_LEVEL for end in (old, new))
    for _ in range(_SECANT_ROUNDS):
        if abs(off) < _SETTLED_SHARE or before == off:
            break
        at = new - off * (new - old) / (off - before)
        there = normals.probability(at).mean() - QUANTILE_LEVEL
        # The end that stays counts half: else it would stay for ever. Source: Dowell & Jarratt 1971.
        old, before = (new, off) if there * off < 0 else (old, before / 2)
        new, off = at, there
    return new


def length_quantile(covariance: Array) -> float:
    """As `length_quantiles`, of one covariance, (3, 3)."""
    return float(length_quantiles(covariance[None])[0])


def length_quantiles(covariances: Array, means: Array | None = None) -> Array:
    """The lengths that normal vectors of these covariances, (n, 3, 3), stay below with `QUANTILE_LEVEL`, (n,).

    Their means, (n, 3), are zero where None.
    """
    if means is None or not np.any(means):
        return _central_quantile(covariances)
    return _non_central(covariances, means).quantile()


class _NonCentral(NamedTuple):
    """Squares of lengths of normal vectors as noncentral chi-squares of the same four cumulants, good to a hundredth.

    A square is `mean + spread * (scaled chi-square, standardised)`; (n,) each. Source: Liu, Tang & Zhang 2009.
    """

    mean: Array
    spread: Array
    scale: Array
    shift: Array
    freedoms: Array

    def quantile(self) -> Array:
        """The lengths that these stay below with `QUANTILE_LEVEL`, (n,)."""
        at = chndtrix(QUANTILE_LEVEL, self.freedoms, self.shift)
        squared = self.mean + (at - self.freedoms - self.shift) / self.scale * self.spread
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)))

    def probability(self, length: float) -> Array:
        """Probability that each is below a length, (n,)."""
        away = length**2 - self.mean
        spread = np.maximum(self.spread, _CERTAIN_M2)
        at = away / spread * self.scale + self.freedoms + self.shift
        return np.asarray(chndtr(np.maximum(at, 0.0), self.freedoms, self.shift))


def _non_central(covariances: Array, means: Array) -> _NonCentral:
    """Quantiles of lengths with covariances, (n, 3, 3), and means, (n, 3)."""
    powers = [np.broadcast_to(np.eye(3), covariances.shape)]
    for _ in range(4):
        powers.append(powers[-1] @ covariances)
    c1, c2, c3, c4 = (
        np.trace(powers[k], axis1=1, axis2=2) + k * np.einsum("ni,nij,nj->n", means, powers[k - 1], means)
        for k in (1, 2, 3, 4)
    )
    known = c2 <= (_LEAST_SHARE * c1) ** 2
    c2 = np.where(known, 1.0, c2)
    skew, tails = np.where(known, 1.0, c3 / c2**1.5), np.where(known, 1.0, c4 / c2**2)
    scale = 1 / (skew - np.sqrt(np.maximum(skew**2 - tails, 0.0)))
    shift = np.maximum(skew * scale**3 - scale**2, 0.0)
    return _NonCentral(c1, np.where(known, 0.0, np.sqrt(c2)), scale, shift, scale**2 - 2 * shift)


def _central_quantile(covariances: Array) -> Array:
    """Quantile of a length with mean zero, to 1e-6.

    Along a direction u, uniform on the sphere, the vector is chi L u. chi has three degrees of freedom, and L L' is the
    covariance. The probability is the mean over u of that of chi < length / |L u|.
    """
    variances = np.maximum(np.linalg.eigvalsh(covariances), 0.0)
    largest = variances[:, -1]
    shares = np.divide(variances, largest[:, None], out=np.ones_like(variances), where=largest[:, None] > 0)
    squares, weights = _octant()
    stretched = np.sqrt(np.maximum(shares @ squares.T, _LEAST_SHARE))
    lengths = np.full(len(variances), _LEAST_QUANTILE)
    for _ in range(
        _NEWTON_ROUNDS
    ):  # of Newton's, from below: the probability is concave there, so that none goes beyond
        chi = lengths[:, None] / stretched
        probability = gammainc(1.5, chi**2 / 2) @ weights
        density = (np.sqrt(2 / np.pi) * chi**2 * np.exp(-(chi**2) / 2) / stretched) @ weights
        lengths = lengths - (probability - QUANTILE_LEVEL) / density
    return np.asarray(np.sqrt(largest) * lengths)


@cache
def _octant() -> tuple[Array, Array]:
    """Squares of the coordinates of directions over an eighth of the sphere, (m, 3), and their weights, (m,)."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    up, turn = np.meshgrid((nodes + 1) / 2, (np.arange(_NODES) + 0.5) / _NODES * np.pi / 2, indexing="ij")
    flat = 1 - up**2
    squares = np.stack([flat * np.cos(turn) ** 2, flat * np.sin(turn) ** 2, up**2], axis=-1)
    return squares.reshape(-1, 3), np.repeat(weights / (2 * _NODES), _NODES)


def point_covariances(covariance: Array, places: Array) -> Array:
    """Covariances of points' positions, (n, 3, 3), in the axes of the source of a transform with this one, (6, 6)."""
    moved = point_jacobian(places)
    at: Array = moved @ covariance @ np.swapaxes(moved, 1, 2)
    return at


def point_jacobian(places: Array) -> Array:
    """How points, (n, 3) [m], move with a right tangent of the transform that carries them, (n, 3, 6), in its axes."""
    return np.concatenate([np.broadcast_to(np.eye(3), (len(places), 3, 3)), -cross_matrix(places)], axis=-1)


def _places(name: str, cell: Cell, evaluation: Evaluation) -> Iterator[Array]:
    """Where a transform `a_from_b` is used, in b, (n, 3) of each group of views."""
    for group in evaluation.problem.groups:
        for end in group.ends:
            if name == end.base:
                yield end.base_from_flange.translation
        if name == group.eye.mount:
            yield evaluation.state.camera_from_target(group, evaluation.problem.stops).translation
        if name == group.hand.mount:
            shape = cell.targets[group.target].target
            yield np.zeros((1, 3)) if shape is None else shape.points  # the origin of one that is seen only as poses
