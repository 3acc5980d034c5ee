"""Views of a static scene, which the unknown points that they show tie together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import SE3, Array, Camera, IntArray

SCENE = "scene"
"""What such views see; its mount is the identity in the world."""


@dataclass(frozen=True, eq=False)
class TiedViews:
    """Image points of a scene to second order about poses and lenses, the points eliminated.

    Source: docs/mathematics.md (4.4).

    The q columns are right tangents of `camera_from_world` of all views, group after group, then parameters of lenses.

    Attributes:
        groups: Of each camera its views.
        camera_from_world: (v,) poses of all views about which it is.
        lenses: Those about which it is, of cameras whose lens is estimated.
        cost: There.
        gradient: (q,).
        information: (q, q).
        count: Scalar residuals less three for each point.
        points: (p, 3) of the scene at their best for these poses [m].
    """

    groups: tuple[ViewGroup, ...]
    camera_from_world: SE3
    lenses: Mapping[str, Camera]
    cost: float
    gradient: Array
    information: Array
    count: int
    points: Array

    @cached_property
    def stops(self) -> IntArray:
        """(k,) stops with noise in which views stand."""
        return np.unique(np.concatenate([group.eye.stop[group.eye.stop >= 0] for group in self.groups]))
