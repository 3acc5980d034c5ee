"""Residuals over the image of a camera: their rms and their mean in each square."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.errors import count_text
from basecal.fields.digits import two_digits
from basecal.geometry import Array
from basecal.reporting.figures.image_grid import image_grid
from basecal.reporting.svg import Figure, element, nice_ceiling, path, segments, three_digits

_ARROW_SHARE = 0.8  # of a square, for an arrow with the length of the ruler
_FEWEST_POINTS = 3  # smallest number of points whose mean is drawn
_ARROWHEAD_PX = 4.0


def residual_map(size_px: tuple[int, int] | None, points: PointResiduals) -> Figure:
    """Squares shaded by the rms of their residuals, with arrows of the mean from observed to predicted points.

    Args:
        size_px: Size of the camera's images; None for the points' bounding box.
        points: Points of the camera, at least one used; unused ones are not drawn.
    """
    residuals = points.off_px[points.used]
    grid = image_grid(size_px, points.pixels[points.used])
    rms = np.sqrt(grid.means(np.mean(residuals**2, axis=-1)))
    mean = np.stack([grid.means(axis) for axis in residuals.T], axis=-1)
    top = nice_ceiling(float(rms.max()))
    some = np.flatnonzero(grid.count)
    count = grid.count[some]
    squares = {
        square: (value / top, f"{count_text(number, 'point')}, rms {two_digits(value)} px per coordinate")
        for square, value, number in zip(some.tolist(), rms.tolist(), count, strict=True)
    }
    is_drawn = count >= _FEWEST_POINTS
    foot, drift = grid.scale * grid.middles[some][is_drawn], mean[is_drawn]
    bar_px = nice_ceiling(float(np.max(np.linalg.norm(drift, axis=-1), initial=0.0)))
    enlargement = _ARROW_SHARE * grid.pitch * grid.scale / bar_px
    bottom = grid.scale * float(grid.size[1]) - 12
    end = 12 + bar_px * enlargement
    svg = grid.drawing(
        f"reprojection errors in the image of {points.camera}",
        squares,
        ("0", f"{top:g} px rms"),
        path("arrows", _arrows(foot, foot + drift * enlargement)),
        path("ruler", segments([np.array([[12, bottom], [end, bottom]])])),
        element("text", f"{bar_px:g} px", class_="ruler-label", x=end + 6, y=bottom + 5),
    )
    caption = (
        f"{count_text(len(residuals), 'point')}. Shade: rms per coordinate, full at {top:g} px. Arrow: mean from "
        f"observed towards predicted points, enlarged {three_digits(enlargement / grid.scale)} times. Arrows that "
        "agree with their neighbours are a pattern that the lens model cannot represent."
    )
    return Figure(f"{points.camera}, residuals over the image", svg, caption)


def _arrows(foot: Array, tip: Array) -> str:
    """Path data of arrows, (n, 2) to (n, 2); short ones have no head."""
    along = tip - foot
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    long = length[:, 0] > 2 * _ARROWHEAD_PX
    unit, end = along[long] / length[long], tip[long]
    back, across = end - _ARROWHEAD_PX * unit, 0.5 * _ARROWHEAD_PX * unit[:, ::-1] * [-1, 1]
    heads = [np.stack([back + side * across, end], 1) for side in (1, -1)]
    return segments(np.concatenate([np.stack([foot, tip], 1), *heads]))
