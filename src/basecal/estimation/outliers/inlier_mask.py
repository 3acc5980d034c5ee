"""Masks of inlier views and points, and problems restricted to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from basecal.estimation.problem.correspondence import half_turn_views
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.measurement import Measurement, Noise
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.target_points import SeenPoints
from basecal.geometry import Array, BoolArray


@dataclass(frozen=True, eq=False)
class InlierMask:
    """Masks of the inliers of a problem.

    Attributes:
        views: Mask of inlier views, (n,), by group.
        points: Mask of inlier points, (n, p), by group, effective in inlier views only; (n, 1) for poses.
    """

    views: tuple[BoolArray, ...]
    points: tuple[BoolArray, ...]

    def same_as(self, mask: InlierMask) -> bool:
        """Whether two masks are equal."""
        pairs = zip((*self.views, *self.points), (*mask.views, *mask.points), strict=True)
        return all(np.array_equal(a, b) for a, b in pairs)

    def intersection(self, mask: InlierMask) -> InlierMask:
        """Inliers of both masks."""
        return InlierMask(
            tuple(a & b for a, b in zip(self.views, mask.views, strict=True)),
            tuple(a & b for a, b in zip(self.points, mask.points, strict=True)),
        )

    @property
    def weights(self) -> tuple[Array, ...]:
        """Weights of views, (n,), by group: 1 for an inlier, else 0."""
        return tuple(v.astype(np.float64) for v in self.views)


def all_inliers(problem: Problem) -> InlierMask:
    """Mask of all views and points of a problem."""
    shapes = [(len(g), point_count(g.measurement)) for g in problem.groups]
    return InlierMask(tuple(np.ones(n, dtype=bool) for n, _ in shapes), tuple(np.ones(s, dtype=bool) for s in shapes))


def point_count(measurement: Measurement) -> int:
    """Maximum number of points of a view; 1 for measured poses."""
    return len(measurement.points_in_target) if isinstance(measurement, SeenPoints) else 1


def without_points(problem: Problem, points: Sequence[BoolArray]) -> Problem:
    """Return the problem with all points outside a mask marked as not seen; the views stay the same."""
    return problem.with_groups(_mask_group(g, kept) for g, kept in zip(problem.groups, points, strict=True))


def inlier_problem(problem: Problem, inliers: InlierMask) -> Problem:
    """Return the problem of the inliers alone, with fixed correspondences and default values of unstated sigmas."""
    masked = without_points(problem, inliers.points).groups
    inlier_groups = (
        replace(g, readings=()).take(np.flatnonzero(v)) for g, v in zip(masked, inliers.views, strict=True) if v.any()
    )
    return problem.with_groups(inlier_groups).with_noise(Noise())


def without_unseen_stops(problem: Problem, state: State) -> State:
    """Return the state with zero errors for stops without views in the problem."""
    has_views = np.zeros(len(problem.stops), dtype=bool)
    for group in problem.groups:
        for stop in (end.stop for end in group.ends):
            has_views[stop[stop >= 0]] = True
    return replace(state, stop_errors=np.where(has_views[:, None], state.stop_errors, 0.0))


def select_samples(problem: Problem, numbers: ArrayLike) -> Problem:
    """Return the problem restricted to samples with the given numbers."""
    return problem.take_views(np.flatnonzero(np.isin(g.sample, numbers)) for g in problem.groups)


def _mask_group(group: ViewGroup, points: BoolArray) -> ViewGroup:
    measurement = group.measurement.mask_points(points)
    if group.half_turn is None or not isinstance(measurement, PixelMeasurement) or points.all():
        return replace(group, measurement=measurement)
    return replace(group, measurement=measurement, readings=(measurement, half_turn_views(measurement)))
