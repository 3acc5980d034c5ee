"""Residuals of points, made by hand."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals


def seen(pixels, off_px, used=None, camera="wrist", target="board"):
    """Residuals of the points of sample 0."""
    count = len(pixels)
    return PointResiduals(
        camera,
        target,
        np.zeros(count, dtype=np.int64),
        np.arange(count),
        np.array(pixels, dtype=np.float64),
        np.array(off_px, dtype=np.float64),
        np.ones(count, dtype=bool) if used is None else np.array(used),
    )
