"""Residuals of points put together, and some of them taken."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.geometry import BoolArray

_ARRAYS = ("sample", "ids", "pixels", "off_px", "used")


def points_by_camera(residuals: Sequence[PointResiduals]) -> dict[str, PointResiduals]:
    """The points of each camera, of all its targets."""
    cameras: dict[str, list[PointResiduals]] = {}
    for each in residuals:
        cameras.setdefault(each.camera, []).append(each)
    return {
        name: PointResiduals(name, "", *(np.concatenate([getattr(each, field) for each in own]) for field in _ARRAYS))
        for name, own in cameras.items()
    }


def some_points(points: PointResiduals, mask: BoolArray) -> PointResiduals:
    """The points that a mask has, (n,)."""
    return PointResiduals(points.camera, points.target, *(getattr(points, field)[mask] for field in _ARRAYS))
