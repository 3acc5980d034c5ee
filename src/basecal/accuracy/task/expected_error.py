"""Expected error of points that a calibration transforms from one frame to another, at the places of use."""

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

QUANTILE_LEVEL = 0.95  # the usual level, stated in reports
_NODES = 12  # quadrature nodes of each angle, for an error of 1e-6 of the quantiles of any covariance
_LEAST_QUANTILE = 1.95  # lower bound of a quantile over the largest sigma: 1.96 if all other sigmas are 0
_NEWTON_ROUNDS = 8  # at most: each doubles the number of correct digits, of which `_NODES` allow six
_SECANT_ROUNDS = 60  # at most: as many bisections would reach 1e-18 of the interval
_SETTLED_SHARE = 1e-12  # tolerance of the probability of a quantile, far below the 1e-6 of `_NODES`
# [m^2] smallest standard deviation of a squared length, for exact lengths: rounding of a square metre squared.
_CERTAIN_M2 = 1e-30
_LEAST_SHARE = 1e-8  # of the largest variance: the root of machine precision, below which a variance is zero


@dataclass(frozen=True, eq=False)
class ExpectedError:
    """The expected error of a transform `a_from_b` at a point, from its covariance.

    Attributes:
        transform: Name of the transform.
        length_m: 95 % quantile of the error of the point's position in a [m].
        at_m: (3,) the point in b [m]: the place of use with the largest variance.
    """

    transform: str
    length_m: float
    at_m: Array


def expected_errors(cell: Cell, calibration: Calibration, evaluation: Evaluation) -> tuple[ExpectedError, ...]:
    """Expected error of each requested transform at its place of use with the largest variance.

    A base is used at the recorded flange positions of its robot. The mount of a camera is used at the target positions,
    and the mount of a target at the target's points. The robots' own errors are not included.

    Args:
        cell: The calibrated cell.
        calibration: Its calibration.
        evaluation: The recording evaluated at the transforms of the calibration.
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
    """Compare the expected error with the tolerance of the settings; None if the settings have no tolerance.

    The error is the largest of the error where flanges meet and the errors of all other requested transforms.
    """
    tolerance_m = calibration.settings.get("tolerance_m")
    if tolerance_m is None:
        return None
    lengths, meeting = {each.transform: each.length_m for each in errors}, calibration.meeting
    is_complete = lengths.keys() == set(cell.requested_transforms)
    if meeting is not None:
        lengths = dict.fromkeys(placed_transforms(cell), meeting.expected_95_m) | {
            name: length for name, length in lengths.items() if name not in placed_transforms(cell)
        }
    found = Tolerance(tolerance_m, max(lengths.values(), default=0.0) if is_complete else None, False)
    return replace(found, met=found.is_within and calibration.verdict == "good")


def pool_errors(covariances: Array, means: Array, task_m: Array) -> MeetingError:
    """Pool the normal distributions of the error at several places into one error.

    Args:
        covariances: (n, 3, 3) covariance at each place [m^2].
        means: (n, 3) mean at each place [m].
        task_m: (k, 3) points of the task [m]; (0, 3) without a task.
    """
    variance = float(np.mean(np.trace(covariances, axis1=1, axis2=2) + np.sum(means**2, -1)))
    return MeetingError(pooled_quantile(covariances, means), place_kind(task_m), float(np.sqrt(variance / 3)))


def pooled_quantile(covariances: Array, means: Array) -> float:
    """Quantile of length at `QUANTILE_LEVEL` of vectors from an equal mixture of normal distributions.

    The length of each component is approximated as in `_NonCentral`.

    Args:
        covariances: (n, 3, 3) covariance of each component.
        means: (n, 3) mean of each component.
    """
    normals = _approximate_squared_lengths(covariances, means)
    own = normals.quantile()
    old, new = float(own.min()), float(own.max())
    before, off = (normals.probability(end).mean() - QUANTILE_LEVEL for end in (old, new))
    for _ in range(_SECANT_ROUNDS):
        if abs(off) < _SETTLED_SHARE or before == off:
            break
        at = new - off * (new - old) / (off - before)
        there = normals.probability(at).mean() - QUANTILE_LEVEL
        # Halve the value at the end that is kept, so that both ends converge. Source: Dowell & Jarratt 1971.
        old, before = (new, off) if there * off < 0 else (old, before / 2)
        new, off = at, there
    return new


def length_quantile(covariance: Array) -> float:
    """Quantile of length as in `length_quantiles`, for one covariance, (3, 3), and zero mean."""
    return float(length_quantiles(covariance[None])[0])


def length_quantiles(covariances: Array, means: Array | None = None) -> Array:
    """Quantiles of length at `QUANTILE_LEVEL` of normal vectors, (n,).

    Args:
        covariances: (n, 3, 3).
        means: (n, 3); zero if None.
    """
    if means is None or not np.any(means):
        return _central_quantile(covariances)
    return _approximate_squared_lengths(covariances, means).quantile()


class _NonCentral(NamedTuple):
    """Squared lengths of normal vectors, approximated by noncentral chi-squares with matched cumulants, to about 1 %.

    A square is `mean + spread * (scaled chi-square, standardised)`; each field is (n,). The first four cumulants are
    used. Source: Liu, Tang & Zhang 2009.
    """

    mean: Array
    spread: Array
    scale: Array
    shift: Array
    freedoms: Array

    def quantile(self) -> Array:
        """Quantiles of the lengths at `QUANTILE_LEVEL`, (n,)."""
        at = chndtrix(QUANTILE_LEVEL, self.freedoms, self.shift)
        squared = self.mean + (at - self.freedoms - self.shift) / self.scale * self.spread
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)))

    def probability(self, length: float) -> Array:
        """Probability of each vector to be shorter than a length, (n,)."""
        away = length**2 - self.mean
        spread = np.maximum(self.spread, _CERTAIN_M2)
        at = away / spread * self.scale + self.freedoms + self.shift
        return np.asarray(chndtr(np.maximum(at, 0.0), self.freedoms, self.shift))


def _approximate_squared_lengths(covariances: Array, means: Array) -> _NonCentral:
    """Approximate the squared lengths of normal vectors with covariances, (n, 3, 3), and means, (n, 3)."""
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
    """Quantiles of length of normal vectors with zero mean and covariances (n, 3, 3), to 1e-6, (n,).

    Along a direction u, uniform on the sphere, the vector is chi L u. chi has three degrees of freedom, and L L' is the
    covariance. The probability is the mean over u of that of chi < length / |L u|.
    """
    variances = np.maximum(np.linalg.eigvalsh(covariances), 0.0)
    largest = variances[:, -1]
    shares = np.divide(variances, largest[:, None], out=np.ones_like(variances), where=largest[:, None] > 0)
    squares, weights = _octant()
    stretched = np.sqrt(np.maximum(shares @ squares.T, _LEAST_SHARE))
    lengths = np.full(len(variances), _LEAST_QUANTILE)
    for _ in range(_NEWTON_ROUNDS):  # Newton steps from below: the probability is concave there, so no step overshoots
        chi = lengths[:, None] / stretched
        probability = gammainc(1.5, chi**2 / 2) @ weights
        density = (np.sqrt(2 / np.pi) * chi**2 * np.exp(-(chi**2) / 2) / stretched) @ weights
        lengths = lengths - (probability - QUANTILE_LEVEL) / density
    return np.asarray(np.sqrt(largest) * lengths)


@cache
def _octant() -> tuple[Array, Array]:
    """Quadrature over an octant of the sphere: squared coordinates of directions, (m, 3), and weights, (m,)."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    up, turn = np.meshgrid((nodes + 1) / 2, (np.arange(_NODES) + 0.5) / _NODES * np.pi / 2, indexing="ij")
    flat = 1 - up**2
    squares = np.stack([flat * np.cos(turn) ** 2, flat * np.sin(turn) ** 2, up**2], axis=-1)
    return squares.reshape(-1, 3), np.repeat(weights / (2 * _NODES), _NODES)


def point_covariances(covariance: Array, places: Array) -> Array:
    """Covariances of transformed points, (n, 3, 3) [m^2], in the axes of the transform's source frame.

    Args:
        covariance: (6, 6) covariance of the transform [m, rad].
        places: (n, 3) points in the source frame [m].
    """
    jacobian = point_jacobian(places)
    covariances: Array = jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
    return covariances


def point_jacobian(places: Array) -> Array:
    """Derivative of points, (n, 3) [m], with respect to a right tangent of their transform, (n, 3, 6).

    The derivative is in the axes of the transform's source frame.
    """
    return np.concatenate([np.broadcast_to(np.eye(3), (len(places), 3, 3)), -cross_matrix(places)], axis=-1)


def _places(name: str, cell: Cell, evaluation: Evaluation) -> Iterator[Array]:
    """Yield the places of use of a transform `a_from_b` in b, (n, 3) [m], for each group of views."""
    for group in evaluation.problem.groups:
        for end in group.ends:
            if name == end.base:
                yield end.base_from_flange.translation
        if name == group.eye.mount:
            yield evaluation.state.camera_from_target(group, evaluation.problem.stops).translation
        if name == group.hand.mount:
            shape = cell.targets[group.target].target
            yield np.zeros((1, 3)) if shape is None else shape.points  # the origin if the target is seen only as poses
