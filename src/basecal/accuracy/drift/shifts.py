"""Shift of a frame, joint or target size since a calibration, its significance, and the smallest detectable shift.

Let y be the innovations, V their covariance, and E their derivative with respect to a shift t. The best t is
(E'V^-1 E)^+ E'V^-1 y. t' (E'V^-1 E) t is chi-square if nothing moved, else noncentral chi-square by the true shift. If
the noise was estimated with n degrees of freedom, the statistic has an F distribution.
Source: docs/mathematics.md (13.2), (13.3).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy  # submodules are loaded on first use
from scipy.special import chdtri, chndtr, fdtri

from basecal.accuracy.drift.innovations import Innovations
from basecal.accuracy.model_comparison.nested_models import log_chance
from basecal.effects.target_size import size_moves
from basecal.geometry import Array
from basecal.numerics.spectral import spectrum

SIZE_KIND = "size"
"""Value of `Shift.transform` for a change of a target's size."""

_HIDDEN_SHARE = 1e-6  # share of the largest eigenvalue of the scaled information, below which a shift is unobservable
_DIRECTION_COUNT = 100  # directions over which the detection probability is averaged, to a thousandth
_SCALE_COUNT = 20  # variance scales over which the detection probability is averaged
_LARGEST_M = 10.0  # [m] larger than any shift in a cell: a shift not detected then is not detectable


@dataclass(frozen=True, eq=False)
class Shift:
    """The shift of one frame, joint offset or target size, estimated from new views.

    Attributes:
        frame: Name of the base, camera or target that moved; for a joint, the flange of its robot.
        transform: Name of the changed transform; empty for a joint, `SIZE_KIND` for the size of a target.
        joint: Number of the joint whose offset changed, from 0; None for a frame.
        size: (k,) best shift: a right tangent of the transform [m, rad], a joint offset [rad], or a relative size.
        covariance: (k, k) covariance of the shift; zero in unobservable directions.
        information: (k, k) information about the shift.
        statistic: Test statistic, chi-square distributed if nothing moved.
        freedoms: Degrees of freedom of the statistic: number of observable directions.
        noise_freedoms: Degrees of freedom of the calibration's estimated noise; infinite if the noise was stated.
    """

    frame: str
    transform: str
    joint: int | None
    size: Array
    covariance: Array
    information: Array
    statistic: float
    freedoms: int
    noise_freedoms: float = np.inf

    @property
    def log_chance(self) -> float:
        """Log p-value of the statistic if nothing moved."""
        return log_chance(self.statistic, self.freedoms, self.noise_freedoms)

    def threshold(self, level: float) -> float:
        """Critical value of the statistic at a significance level."""
        if not np.isfinite(self.noise_freedoms):
            return float(chdtri(self.freedoms, level))
        return self.freedoms * float(fdtri(self.freedoms, self.noise_freedoms, 1 - level))

    @property
    def shift_m(self) -> float:
        """Length of the translation [m]; 0 for a joint."""
        return 0.0 if self.joint is not None else float(np.linalg.norm(self.size[:3]))

    @property
    def shift_rad(self) -> float:
        """Angle of the rotation or of the joint offset [rad]."""
        return float(np.linalg.norm(self.size[3:] if self.joint is None else self.size))


def frame_shifts(innovations: Innovations) -> Iterator[Shift]:
    """Yield the shift of each base, camera and target that views depend on; single points have no rotation."""
    for name in innovations.situation.frames:
        frame, moves = name.partition("_from_")[2], innovations.frame_jacobian(name)
        if name in innovations.situation.problem.point_mounts:
            moves = moves * np.repeat([1.0, 0.0], 3)
        yield _shift(innovations, frame, name, None, moves)


def joint_shifts(innovations: Innovations) -> Iterator[Shift]:
    """Yield the offset shift of each joint of the robots that were recorded by joints."""
    for robot in innovations.robots:
        by_joints = innovations.joint_jacobian(robot)
        for joint in range(by_joints.shape[-1]):
            yield _shift(innovations, f"{robot}_flange", "", joint, by_joints[..., joint : joint + 1])


def size_shifts(innovations: Innovations) -> Iterator[Shift]:
    """Yield the relative size change of each target with a size; an exchanged board may differ in size."""
    problem = innovations.situation.problem
    for target in sorted({g.target for g in problem.groups if g.hand.mount not in problem.point_mounts}):
        groups = enumerate(problem.groups)
        moves = [size_moves(innovations.situation, k) * float(group.target == target) for k, group in groups]
        yield _shift(innovations, target, SIZE_KIND, None, np.concatenate(moves))


def _shift(innovations: Innovations, frame: str, transform: str, joint: int | None, moves: Array) -> Shift:
    by_shift = innovations.whiten(moves)
    weighed = by_shift.T @ innovations.covariance_inverse
    information = weighed @ by_shift
    seen = spectrum(0.5 * (information + information.T), _HIDDEN_SHARE)
    size = seen.inverse @ (weighed @ innovations.deviation)
    statistic = float(size @ information @ size)
    return Shift(
        frame,
        transform,
        joint,
        size,
        seen.inverse,
        information,
        statistic,
        int(seen.rank),
        innovations.noise_freedoms,
    )


def detectable_m(shift: Shift, level: float, power: float) -> float | None:
    """Length of a translation in a uniformly random direction that is detected with probability `power`.

    Args:
        shift: Estimated shift of the frame.
        level: Significance level of the detection, the false alarm rate.
        power: Detection probability.

    Returns:
        The length [m], or None if a shift of 10 m is not detected with this probability.
    """
    along = _directions(_DIRECTION_COUNT)
    noncentrality_per_m2 = np.maximum(np.einsum("di,ij,dj->d", along, shift.information[:3, :3], along), 0.0)
    if not shift.freedoms:
        return None
    # Equally likely ratios of the estimated to the true variance, for its degrees of freedom.
    chances = 1 - (np.arange(_SCALE_COUNT) + 0.5) / _SCALE_COUNT
    is_estimated = np.isfinite(shift.noise_freedoms)
    scales = chdtri(shift.noise_freedoms, chances) / shift.noise_freedoms if is_estimated else np.ones(1)
    threshold = shift.threshold(level) * scales[:, None]

    def excess_power(length_m: float) -> float:
        """Detection probability of a shift of a length, less `power`."""
        return 1 - float(np.mean(chndtr(threshold, shift.freedoms, length_m**2 * noncentrality_per_m2))) - power

    if excess_power(_LARGEST_M) < 0:
        return None
    return float(scipy.optimize.brentq(excess_power, 0.0, _LARGEST_M, xtol=1e-9))


def _directions(count: int) -> Array:
    """Evenly distributed directions, (count, 3). Source: Gonzalez 2010, the Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z, azimuth = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1)
