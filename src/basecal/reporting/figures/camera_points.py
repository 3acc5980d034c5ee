"""Grouping and selection of residuals of points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.geometry import BoolArray

_ARRAYS = ("sample", "ids", "pixels", "off_px", "used")


def points_by_camera(residuals: Sequence[PointResiduals]) -> dict[str, PointResiduals]:
    """Points of each camera on all targets."""
    cameras: dict[str, list[PointResiduals]] = {}
    for each in residuals:
        cameras.setdefault(each.camera, []).append(each)
    return {
        name: PointResiduals(name, "", *(np.concatenate([getattr(each, field) for each in own]) for field in _ARRAYS))
        for name, own in cameras.items()
    }


def some_points(points: PointResiduals, mask: BoolArray) -> PointResiduals:
    """Points selected by a mask, (n,)."""
    return PointResiduals(points.camera, points.target, *(getattr(points, field)[mask] for field in _ARRAYS))
