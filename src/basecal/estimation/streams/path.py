"""Where a robot was between the instants at which it was recorded.

Between two records the tangent from the first follows a cubic. Its slopes at both ends are those of the records around
them (Catmull and Rom 1974, of unequal spacing). The velocity therefore has no jumps.
Source: docs/mathematics.md (12.1).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from basecal.geometry import SE3, Array, BoolArray, IntArray
from basecal.geometry.se3_jacobians import right_jacobian
from basecal.kinematics import SerialChain

LARGEST_GAP_S = 0.25
"""Of records between which a robot is taken to go smoothly [s]: arms change what they do within some tenths of it."""


@dataclass(frozen=True, eq=False)
class PathPoints:
    """A robot at some instants.

    Attributes:
        base_from_flange: (n,) poses.
        joints: (n, k) [rad]; None if poses were recorded.
        velocity: (n, 6) of the flange in its own axes [m/s, rad/s].
    """

    base_from_flange: SE3
    joints: Array | None
    velocity: Array


@dataclass(frozen=True, eq=False)
class Path:
    """The recorded path of a robot.

    Attributes:
        times: (n,) [s], rising.
        base_from_flange: (n,) as recorded, or by the joints.
        joints: (n, k) [rad]; None if poses were recorded.
        chain: The robot's kinematics, where joints were.
    """

    times: Array
    base_from_flange: SE3
    joints: Array | None = None
    chain: SerialChain | None = None

    @cached_property
    def steady_intervals(self) -> BoolArray:
        """(n - 1,) whether the robot can be followed from each record to the next."""
        return np.asarray(np.diff(self.times) <= LARGEST_GAP_S)

    @cached_property
    def isolated_records(self) -> BoolArray:
        """(n,) records with none near them, as of a robot that was recorded where it stood."""
        apart = np.concatenate([[True], ~self.steady_intervals, [True]])
        return np.asarray(apart[1:] & apart[:-1])

    def known_mask(self, times: Array) -> BoolArray:
        """Whether it is known where the robot was at instants, (m,)."""
        if len(self.times) < 2:
            return np.zeros(len(times), dtype=bool)
        inside = (times >= self.times[0]) & (times <= self.times[-1])
        return np.asarray(
            (inside & self.steady_intervals[self._preceding_records(times)]) | self._nearest_rest(times)[1]
        )

    def evaluate(self, times: Array) -> PathPoints:
        """The robot at instants at which that is known, (m,)."""
        record, stood = self._nearest_rest(times)
        points = self._interpolate(np.where(stood, self.times[record], times))
        return replace(points, velocity=np.where(stood[:, None], 0.0, points.velocity))

    def _nearest_rest(self, times: Array) -> tuple[IntArray, BoolArray]:
        """The nearest record to each instant, and whether the robot stood there."""
        before = self._preceding_records(times)
        nearest = np.where(times - self.times[before] > self.times[before + 1] - times, before + 1, before)
        near = np.abs(times - self.times[nearest]) <= LARGEST_GAP_S
        return nearest, np.asarray(near & self.isolated_records[nearest])

    def _interpolate(self, times: Array) -> PathPoints:
        """Between records, at instants (m,)."""
        first = self._preceding_records(times)
        if self.joints is not None and self.chain is not None:
            start = self.joints[first]
            turned, rate = self._cubic(first, times, [self.joints[k] - start for k in self._neighbour_records(first)])
            there = self.chain.posture(start + turned)
            return PathPoints(there.base_from_flange, start + turned, _times(there.joint_derivative, rate))
        at_first = self.base_from_flange[first]
        away = [(at_first.inverse() @ self.base_from_flange[k]).log() for k in self._neighbour_records(first)]
        tangent, rate = self._cubic(first, times, away)
        return PathPoints(at_first @ SE3.exp(tangent), None, _times(right_jacobian(tangent), rate))

    def _preceding_records(self, times: Array) -> IntArray:
        """Which record comes before each instant, the last but one at most; of one that ends a way the one before."""
        first = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2).astype(np.int64)
        ends = (
            (self.times[first] == times)
            & ~self.steady_intervals[first]
            & self.steady_intervals[np.maximum(first - 1, 0)]
        )
        return np.where(ends, first - 1, first)

    def _neighbour_records(self, first: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """The records before a first, after it, and after that; at a pause or an end those of the gap itself."""
        second = first + 1
        before = np.where((first > 0) & self.steady_intervals[np.maximum(first - 1, 0)], first - 1, first)
        last = len(self.times) - 1
        after = np.where((second < last) & self.steady_intervals[np.minimum(second, last - 1)], second + 1, second)
        return before, second, after

    def _cubic(self, first: IntArray, times: Array, distances: list[Array]) -> tuple[Array, Array]:
        """How far instants are from their first records, (m, k), and how fast, of how far records around are."""
        before, second, after = self._neighbour_records(first)
        back, end, on = distances
        gap = (self.times[second] - self.times[first])[:, None]
        start_slope = (end - back) / (self.times[second] - self.times[before])[:, None]
        end_slope = on / (self.times[after] - self.times[first])[:, None]
        s = (times - self.times[first])[:, None] / gap
        value = s * (1 - s) ** 2 * gap * start_slope + s**2 * (3 - 2 * s) * end - s**2 * (1 - s) * gap * end_slope
        slope = (1 - s) * (1 - 3 * s) * start_slope + 6 * s * (1 - s) * end / gap - s * (2 - 3 * s) * end_slope
        return value, slope


def _times(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[..., None])[..., 0])
