"""Where in the image of a camera points were seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.image_grid import image_grid


def image_coverage(camera: str, size_px: tuple[int, int] | None, views: Sequence[PointResiduals]) -> Figure:
    """Squares shaded by how many points were seen in them.

    Args:
        camera: Its name.
        size_px: Its image; where not known, as far as points were seen.
        views: Its points, at least one.
    """
    pixels = np.concatenate([each.pixels for each in views])
    grid = image_grid(size_px, pixels)
    count = grid.sums(np.ones(len(pixels))).astype(np.int64)
    some = np.flatnonzero(count)
    shade = np.sqrt(count[some] / count.max())
    tiles = [
        grid.tile(int(square), float(share), f"{number} point{'s' if number > 1 else ''}")
        for square, share, number in zip(some, shade, count[some].tolist(), strict=True)
    ]
    svg = grid.drawing(f"points in the image of {camera}", "1 point", str(count.max()), *tiles)
    caption = (
        f"Points were seen in {len(some)} of {len(count)} squares ({100 * len(some) / len(count):.0f} %), "
        f"at most {count.max()} in one. What the lens does in the others is not checked."
    )
    return Figure(f"{camera}, where points were seen", svg, caption)
