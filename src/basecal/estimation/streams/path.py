"""Interpolation of a recorded robot path.

Between two records, the tangent relative to the first is a cubic polynomial. Its slopes at both records are the slopes
between their neighbours (Catmull and Rom 1974, for unequal spacing). The velocity is therefore continuous.
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
"""Largest gap between records that is interpolated [s]: arms change their motion within some tenths of a second."""


@dataclass(frozen=True, eq=False)
class PathPoints:
    """States of a robot at several times.

    Attributes:
        base_from_flange: (n,) poses.
        joints: (n, k) [rad]; None if poses were recorded.
        velocity: (n, 6) velocity of the flange in its own axes [m/s, rad/s].
    """

    base_from_flange: SE3
    joints: Array | None
    velocity: Array


@dataclass(frozen=True, eq=False)
class Path:
    """Recorded path of a robot.

    Attributes:
        times: (n,) increasing times [s].
        base_from_flange: (n,) recorded poses, or poses from the recorded joints.
        joints: (n, k) [rad]; None if poses were recorded.
        chain: Kinematics of the robot; None if poses were recorded.
    """

    times: Array
    base_from_flange: SE3
    joints: Array | None = None
    chain: SerialChain | None = None

    @cached_property
    def steady_intervals(self) -> BoolArray:
        """Whether the gap after each record can be interpolated, (n - 1,)."""
        return np.asarray(np.diff(self.times) <= LARGEST_GAP_S)

    @cached_property
    def isolated_records(self) -> BoolArray:
        """Whether each record has a large gap on both sides, (n,), such as records of a robot at rest."""
        is_gap = np.concatenate([[True], ~self.steady_intervals, [True]])
        return np.asarray(is_gap[1:] & is_gap[:-1])

    def known_mask(self, times: Array) -> BoolArray:
        """Whether the pose of the robot is known at times (m,), (m,)."""
        if len(self.times) < 2:
            return np.zeros(len(times), dtype=bool)
        inside = (times >= self.times[0]) & (times <= self.times[-1])
        return np.asarray((inside & self.steady_intervals[self._interval_starts(times)]) | self._nearest_rest(times)[1])

    def evaluate(self, times: Array) -> PathPoints:
        """Evaluate the path at times (m,) at which it is known."""
        nearest, is_resting = self._nearest_rest(times)
        points = self._interpolate(np.where(is_resting, self.times[nearest], times))
        return replace(points, velocity=np.where(is_resting[:, None], 0.0, points.velocity))

    def _nearest_rest(self, times: Array) -> tuple[IntArray, BoolArray]:
        """Nearest record to each time, and whether it is an isolated record of a robot at rest near this time."""
        before = self._interval_starts(times)
        nearest = np.where(times - self.times[before] > self.times[before + 1] - times, before + 1, before)
        near = np.abs(times - self.times[nearest]) <= LARGEST_GAP_S
        return nearest, np.asarray(near & self.isolated_records[nearest])

    def _interpolate(self, times: Array) -> PathPoints:
        """Interpolate between records at times (m,)."""
        first = self._interval_starts(times)
        if self.joints is not None and self.chain is not None:
            start = self.joints[first]
            joint_change, rate = self._cubic(
                first, times, [self.joints[k] - start for k in self._neighbour_records(first)]
            )
            posture = self.chain.posture(start + joint_change)
            return PathPoints(posture.base_from_flange, start + joint_change, _multiply(posture.joint_derivative, rate))
        at_first = self.base_from_flange[first]
        tangents = [(at_first.inverse() @ self.base_from_flange[k]).log() for k in self._neighbour_records(first)]
        tangent, rate = self._cubic(first, times, tangents)
        return PathPoints(at_first @ SE3.exp(tangent), None, _multiply(right_jacobian(tangent), rate))

    def _interval_starts(self, times: Array) -> IntArray:
        """Index of the record before each time, at most the second-last.

        For the last record of a continuous part, it is the record before, so that the interpolated gap is short.
        """
        first = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2).astype(np.int64)
        is_last = (
            (self.times[first] == times)
            & ~self.steady_intervals[first]
            & self.steady_intervals[np.maximum(first - 1, 0)]
        )
        return np.where(is_last, first - 1, first)

    def _neighbour_records(self, first: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """Indices of the record before each first, the next one, and the one after; without crossing large gaps.

        At a large gap or an end of the path, the record of the interpolated interval itself is repeated.
        """
        second = first + 1
        before = np.where((first > 0) & self.steady_intervals[np.maximum(first - 1, 0)], first - 1, first)
        last = len(self.times) - 1
        after = np.where((second < last) & self.steady_intervals[np.minimum(second, last - 1)], second + 1, second)
        return before, second, after

    def _cubic(self, first: IntArray, times: Array, tangents: list[Array]) -> tuple[Array, Array]:
        """Cubic interpolation: tangents at times (m,) relative to their first records, and their rates, (m, k) each.

        `tangents` are the tangents of the three neighbours of the first records, relative to these.
        """
        before, second, after = self._neighbour_records(first)
        to_previous, to_second, to_next = tangents
        gap = (self.times[second] - self.times[first])[:, None]
        start_slope = (to_second - to_previous) / (self.times[second] - self.times[before])[:, None]
        end_slope = to_next / (self.times[after] - self.times[first])[:, None]
        s = (times - self.times[first])[:, None] / gap
        value = s * (1 - s) ** 2 * gap * start_slope + s**2 * (3 - 2 * s) * to_second - s**2 * (1 - s) * gap * end_slope
        slope = (1 - s) * (1 - 3 * s) * start_slope + 6 * s * (1 - s) * to_second / gap - s * (2 - 3 * s) * end_slope
        return value, slope


def _multiply(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[..., None])[..., 0])
