"""Where in the image of a camera points were points."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.image_grid import image_grid


def image_coverage(size_px: tuple[int, int] | None, points: PointResiduals) -> Figure:
    """Squares shaded by how many points were seen in them.

    Args:
        size_px: The camera's image; where not known, as far as points were points.
        points: Its points, at least one.
    """
    grid = image_grid(size_px, points.pixels)
    most = int(grid.count.max())
    squares = {
        square: (float(np.sqrt(number / most)), f"{number} point{'s' if number > 1 else ''}")
        for square, number in enumerate(grid.count.tolist())
        if number
    }
    svg = grid.drawing(f"points in the image of {points.camera}", squares, ("1 point", str(most)))
    share = len(squares) / len(grid.count)
    caption = (
        f"Points were seen in {len(squares)} of {len(grid.count)} squares ({100 * share:.0f} %), "
        f"at most {most} in one. What the lens does in the others is not checked."
    )
    return Figure(f"{points.camera}, where points were seen", svg, caption)
