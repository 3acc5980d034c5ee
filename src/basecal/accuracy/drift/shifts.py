"""Whether one thing has moved since a calibration, by how much, and how small a shift would be seen.

y are the innovations, V their covariance, and E their derivative to a shift t of the thing. The best t is (E'V^-1 E)^+
E'V^-1 y. t' (E'V^-1 E) t is chi-square if nothing moved, else noncentral by the true shift. If the noise was estimated
from n degrees of freedom, it is divided by a chi-square of these and has Fisher's distribution.
Source: docs/mathematics.md (13.2), (13.3).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are loaded when they are first used
from scipy.special import chdtri, chndtr, fdtri

from basecal.accuracy.drift.innovations import Innovations
from basecal.accuracy.model_comparison.nested_models import log_chance
from basecal.effects.target_size import size_moves
from basecal.geometry import Array
from basecal.numerics.spectral import spectrum

SIZE_KIND = "size"
"""Stands for the transform of a shift that is a target's size."""

_HIDDEN_SHARE = 1e-6  # share of its information in any one coordinate below which a direction of a shift is not seen
_DIRECTION_COUNT = 100  # over which the chance to see a shift is averaged, to a thousandth
_SCALE_COUNT = 20  # of a variance, over which it is averaged too
_LARGEST_M = 10.0  # a shift that no cell has [m]: what is not seen then is not seen at all


@dataclass(frozen=True, eq=False)
class Shift:
    """The shift of one frame, estimated from new views.

    Attributes:
        frame: What moved: a base, a camera, a target, or the flange of a robot whose joint's zero did.
        transform: The transform that is no longer true; empty for a joint, `SIZE_KIND` for the size of a target.
        joint: Number of the joint whose zero moved, from 0; None for a frame.
        size: (k,) the best shift, a right tangent of the transform [m, rad], the joint's [rad], or a fraction.
        covariance: (k, k); directions that are not seen hold nothing.
        information: (k, k) of the shift.
        statistic: Chi-square where it did not move.
        freedoms: Of that; directions in which the views would see it.
        of_noise: Freedoms by which the noise of the calibration is known; infinite where it was stated.
    """

    frame: str
    transform: str
    joint: int | None
    size: Array
    covariance: Array
    information: Array
    statistic: float
    freedoms: int
    of_noise: float = np.inf

    @property
    def log_chance(self) -> float:
        """Logarithm of the chance of a statistic so large where it did not move."""
        return log_chance(self.statistic, self.freedoms, self.of_noise)

    def threshold(self, level: float) -> float:
        """The statistic that is passed by this chance where it did not move."""
        if not np.isfinite(self.of_noise):
            return float(chdtri(self.freedoms, level))
        return self.freedoms * float(fdtri(self.freedoms, self.of_noise, 1 - level))

    @property
    def shift_m(self) -> float:
        """Translation of its origin [m]; 0 of a joint."""
        return 0.0 if self.joint is not None else float(np.linalg.norm(self.size[:3]))

    @property
    def shift_rad(self) -> float:
        """Angle of its rotation [rad]."""
        return float(np.linalg.norm(self.size[3:] if self.joint is None else self.size))


def frame_shifts(innovations: Innovations) -> Iterator[Shift]:
    """Each base, camera and target that views depend on; a tip, or another single point, has no rotation."""
    for name in innovations.situation.frames:
        frame, moves = name.partition("_from_")[2], innovations.frame_jacobian(name)
        if name in innovations.situation.problem.point_mounts:
            moves = moves * np.repeat([1.0, 0.0], 3)
        yield _shift(innovations, frame, name, None, moves)


def joint_shifts(innovations: Innovations) -> Iterator[Shift]:
    """The zero of each joint of the robots that were recorded by joints."""
    for robot in innovations.robots:
        by_joints = innovations.joint_jacobian(robot)
        for joint in range(by_joints.shape[-1]):
            yield _shift(innovations, f"{robot}_flange", "", joint, by_joints[..., joint : joint + 1])


def size_shifts(innovations: Innovations) -> Iterator[Shift]:
    """The size of each target that is no single point, by a fraction: another board shows as larger or smaller."""
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
    size = seen.inverse @ (weighed @ innovations.off)
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
        innovations.freedoms_of_noise,
    )


def detectable_m(shift: Shift, level: float, power: float) -> float | None:
    """The length of a shift of a frame, in a uniformly random direction, that is detected with a chance of `power` [m].

    Args:
        shift: Of the frame.
        level: Chance by which one is seen where there is none.
        power: That chance.

    Returns:
        None where no shift that a cell may have is seen so.
    """
    along = _sphere(_DIRECTION_COUNT)
    visible = np.maximum(np.einsum("di,ij,dj->d", along, shift.information[:3, :3], along), 0.0)
    if not shift.freedoms:
        return None
    # What a variance that is known by so many freedoms may be over the true one, as many that are alike likely.
    chances = 1 - (np.arange(_SCALE_COUNT) + 0.5) / _SCALE_COUNT
    known = np.isfinite(shift.of_noise)
    scales = chdtri(shift.of_noise, chances) / shift.of_noise if known else np.ones(1)
    threshold = shift.threshold(level) * scales[:, None]

    def detection_chance(length_m: float) -> float:
        """The chance to see a shift of a length, less what is asked."""
        return 1 - float(np.mean(chndtr(threshold, shift.freedoms, length_m**2 * visible))) - power

    if detection_chance(_LARGEST_M) < 0:
        return None
    return float(scipy.optimize.brentq(detection_chance, 0.0, _LARGEST_M, xtol=1e-9))


def _sphere(count: int) -> Array:
    """Directions spread evenly, (count, 3). Source: Gonzalez 2010, the Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
