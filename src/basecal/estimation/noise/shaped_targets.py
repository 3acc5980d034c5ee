"""Targets of a problem whose shape is estimated, and the problem with the estimated shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.effects.target_shape import BOW_COEFFICIENTS, has_area, is_flat, unit_shifts
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array

_FEWEST_POINTS = 9  # with fewer points, such as a tag's four corners, shape and pose are hardly separable; assumed
_MOST_POINTS_3D = 40  # maximum number of points of a 3-D target, with three unknowns each, to bound the time; assumed


def shaped_targets(problem: Problem) -> dict[str, int]:
    """Number of shape coefficients of each target whose shape is estimated, by name.

    Only targets with many points in images have a shape. A board is assumed exact if it is stated as exact, or if the
    sigmas of its pixels are stated.
    """
    open_groups = (group for group in problem.groups if group.target not in problem.exact_targets)
    counts = {group.target: _coefficient_count(group) for group in open_groups}
    return {target: count for target, count in counts.items() if count}


def _coefficient_count(group: ViewGroup) -> int:
    points = shaped_points(group)
    if len(points) < _FEWEST_POINTS:
        return 0
    if not is_flat(points):
        return points.size if len(points) <= _MOST_POINTS_3D else 0
    unstated = group.measurement.counts()["pixel_px"] > 0
    return BOW_COEFFICIENTS if unstated and has_area(points) else 0


def shaped_points(group: ViewGroup) -> Array:
    """Points of a group's target if it is observed in pixels, (p, 3) [m]; else (0, 3)."""
    measurement = group.measurement
    return measurement.points_in_target if isinstance(measurement, PixelMeasurement) else np.zeros((0, 3))


def reshape_targets(problem: Problem, shapes: Mapping[str, Array]) -> Problem:
    """Return the problem with the given shape coefficients of targets, (k,) in sigmas, in place of the current ones."""
    groups = []
    for group in problem.groups:
        measurement, shape = group.measurement, shapes.get(group.target)
        if shape is None or not isinstance(measurement, PixelMeasurement):
            groups.append(group)
            continue
        change = shape - problem.shapes.get(group.target, np.zeros(len(shape)))
        points = measurement.points_in_target + unit_shifts(measurement.points_in_target) @ change
        readings = tuple(replace(r, points_in_target=points) for r in group.readings)
        groups.append(replace(group, measurement=replace(measurement, points_in_target=points), readings=readings))
    return replace(problem.with_groups(groups), shapes={**problem.shapes, **shapes})
