"""Views of a static scene, coupled by unknown scene points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import SE3, Array, Camera, IntArray

SCENE = "scene"
"""Name of the target of scene views; its mount is the identity in the world."""


@dataclass(frozen=True, eq=False)
class TiedViews:
    """Quadratic cost of a scene's image points about poses and lenses, with the scene points eliminated.

    Source: docs/mathematics.md (4.4).

    The q columns are right tangents of `camera_from_world` of all views, group after group, then parameters of lenses.

    Attributes:
        groups: Views, one group per camera.
        camera_from_world: (v,) poses of all views at the linearisation point.
        lenses: Lenses at the linearisation point, of cameras whose lens is estimated.
        cost: Cost at the linearisation point.
        gradient: (q,) J'r of the views.
        information: (q, q) J'J of the views.
        count: Number of scalar residuals minus three per scene point.
        points: (p, 3) optimal scene points for these poses [m].
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
        """Indices of the stops with noise that the views belong to, (k,), sorted."""
        return np.unique(np.concatenate([group.eye.stop[group.eye.stop >= 0] for group in self.groups]))
