"""Targets that are not shaped as stated: what each point is off by moves it in all views alike.

A flat board is bowed, see `board_bow`. Of a target made in space (a printed body, tags on a cube) each point is off by
itself, under a prior; what the body is shifted and turned by is its mount's. Where it is left out, a turn of the target
that shows other points passes for an error of the arm that turned it. Source: docs/mathematics.md (5.5).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.estimation.noise.board_bow import COEFFICIENTS, bow_of
from basecal.estimation.problem.problem import Problem, ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array
from basecal.geometry.rotation import hat
from basecal.numerics.spectral import dimension

# Fewer points hardly tell a shape from a view's pose: a tag's four corners do not at all.
_FEWEST_POINTS = 9
_MOST_IN_SPACE = 40  # points in space, which bounds the time: three unknowns each
_THIN = 0.05  # of the extent: beyond it a target is made in space, not bowed
# One standard deviation of a coordinate, of the half size: bodies of printed plastic are made to 0.5 %, assembled ones
# to some tenths of a millimetre on a decimetre.
_SIGMA = 5e-3


def shaped_targets(problem: Problem) -> dict[str, int]:
    """How many coefficients the shape has of each target of many points seen in pixels.

    Boards are taken to be as flat as stated where the sigmas of their pixels are stated, too.
    """
    counts = {group.target: _coefficients(group) for group in problem.groups}
    return {target: count for target, count in counts.items() if count}


def _coefficients(group: ViewGroup) -> int:
    points = points_of(group)
    if len(points) < _FEWEST_POINTS:
        return 0
    if not is_flat(points):
        return points.size if len(points) <= _MOST_IN_SPACE else 0
    unstated = group.measurement.counts()["pixel_px"] > 0
    return COEFFICIENTS if unstated and dimension(points, _THIN) > 1 else 0


def is_flat(points_in_target: Array) -> bool:
    """Whether points, (p, 3), lie in a plane but for what a board may be bowed by."""
    return dimension(points_in_target, _THIN) < 3


def points_of(group: ViewGroup) -> Array:
    """Points of a group's target that may have a shape of their own, (p, 3) [m]; none of a measurement without."""
    measurement = group.measurement
    return measurement.points_in_target if isinstance(measurement, PixelMeasurement) else np.zeros((0, 3))


def shape_of(points_in_target: Array) -> Array:
    """How the points of a target, (p, 3) [m], move by each coefficient of its shape, (p, 3, k) [m per sigma]."""
    if is_flat(points_in_target):
        return bow_of(points_in_target)
    centred = points_in_target - points_in_target.mean(0)
    count = len(points_in_target)
    rigid = np.concatenate([np.broadcast_to(np.eye(3), (count, 3, 3)), hat(centred)], -1).reshape(3 * count, 6)
    onto = np.linalg.qr(rigid)[0]
    half = float(np.linalg.norm(centred, axis=1).max())
    return np.asarray(_SIGMA * half * (np.eye(3 * count) - onto @ onto.T)).reshape(count, 3, 3 * count)


def reshaped(problem: Problem, shapes: Mapping[str, Array]) -> Problem:
    """The problem with targets of these coefficients, (k,) in sigmas, in place of those they had."""
    groups = []
    for group in problem.groups:
        measurement, shape = group.measurement, shapes.get(group.target)
        if shape is None or not isinstance(measurement, PixelMeasurement):
            groups.append(group)
            continue
        change = shape - problem.shapes.get(group.target, np.zeros(len(shape)))
        points = measurement.points_in_target + shape_of(measurement.points_in_target) @ change
        readings = tuple(replace(r, points_in_target=points) for r in group.readings)
        groups.append(replace(group, measurement=replace(measurement, points_in_target=points), readings=readings))
    return replace(problem.with_groups(groups), shapes={**problem.shapes, **shapes})


def off_m(points_in_target: Array, shape: Array) -> Array:
    """How far each point of a target is from where it is stated, (p,) [m]."""
    return np.asarray(np.linalg.norm(shape_of(points_in_target) @ shape, axis=1))
