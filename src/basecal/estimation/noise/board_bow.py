"""Boards that are not as flat as stated: a quadratic surface in place of the plane, its coefficients under a prior.

A printed board is bowed by 0.1 to 0.6 % of its half size. Seen at a slant that moves corners by a pixel and more, in
all views alike, and where it is left out lens and mounts take it up. Source: docs/mathematics.md (5.5).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem, ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array
from basecal.numerics.spectral import least_norm

# One standard deviation of a coefficient, of the half size: the middle of the 0.1 to 0.6 % above.
_SIGMA = 3e-3
# Fewer points hardly tell a surface from the plane and a view's pose: a tag's four corners do not at all.
_FEWEST_POINTS = 9
_THIN = 0.05  # of the extent: beyond it a target is made in space, not bowed
_STEEP = 0.9  # component of the normal beyond which an axis of the target does not serve as one of the plane
COEFFICIENTS = 3


def bowed_targets(problem: Problem) -> tuple[str, ...]:
    """Names of the flat targets of many points that cameras see in pixels without a stated sigma."""
    return tuple(dict.fromkeys(g.target for g in problem.groups if _may_bow(g)))


def _may_bow(group: ViewGroup) -> bool:
    measurement = group.measurement
    if not isinstance(measurement, PixelMeasurement) or len(measurement.points_in_target) < _FEWEST_POINTS:
        return False
    values = np.linalg.svd(measurement.points_in_target - measurement.points_in_target.mean(0), compute_uv=False)
    return bool(values[1] > _THIN * values[0] > values[2]) and bool(measurement.counts()["pixel_px"])


def points_of(group: ViewGroup) -> Array:
    """Points of a group's target that may bow, (p, 3) [m]; none of a measurement without."""
    measurement = group.measurement
    return measurement.points_in_target if isinstance(measurement, PixelMeasurement) else np.zeros((0, 3))


def shape_of(points_in_target: Array) -> Array:
    """How the points of a flat target, (p, 3) [m], move by each coefficient of its bow, (p, 3, 3) [m per sigma].

    The coefficients are those of u^2, u v and v^2, with u and v from -1 to 1 over the half size.
    """
    plane, normal = _plane(points_in_target)
    half = float(np.abs(plane).max())
    u, v = (plane / half).T
    heights = _SIGMA * half * np.stack([u * u, u * v, v * v], -1)
    return np.asarray(heights[:, None, :] * normal[None, :, None])


def _plane(points_in_target: Array) -> tuple[Array, Array]:
    """Places in the plane of points from their middle, (p, 2) [m], and the unit vector across it, (3,).

    The axes are those of the target turned least: which they are does not hang on the points' shape.
    """
    centred = points_in_target - points_in_target.mean(0)
    normal = np.linalg.svd(centred, full_matrices=True)[2][2]
    normal = normal * np.sign(normal[np.argmax(np.abs(normal))])
    first = np.eye(3)[0 if abs(normal[0]) < _STEEP else 1]
    u = first - (first @ normal) * normal
    u /= np.linalg.norm(u)
    return centred @ np.stack([u, np.cross(normal, u)], -1), normal


def bent(problem: Problem, bows: Mapping[str, Array]) -> Problem:
    """The problem with targets bowed by these coefficients, (3,) in sigmas, in place of those they had."""
    groups = []
    for group in problem.groups:
        measurement, bow = group.measurement, bows.get(group.target)
        if bow is None or not isinstance(measurement, PixelMeasurement):
            groups.append(group)
            continue
        change = bow - problem.bows.get(group.target, np.zeros(COEFFICIENTS))
        points = measurement.points_in_target + shape_of(measurement.points_in_target) @ change
        readings = tuple(replace(r, points_in_target=points) for r in group.readings)
        groups.append(replace(group, measurement=replace(measurement, points_in_target=points), readings=readings))
    return replace(problem.with_groups(groups), bows={**problem.bows, **bows})


def height_m(points_in_target: Array, bow: Array) -> float:
    """How far a bowed target's points lie from their own plane, the largest distance [m]."""
    plane, normal = _plane(points_in_target)
    heights = (shape_of(points_in_target) @ bow) @ normal
    rows = np.concatenate([plane, np.ones((len(plane), 1))], -1)
    return float(np.abs(heights - rows @ least_norm(rows, heights)).max())
