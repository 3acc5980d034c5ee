"""Residuals over the image of a camera: how large they are in each square, and where they go on average."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.geometry import Array
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.image_grid import image_grid
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import element, nice_ceiling, segments, text, three_digits

_ARROW_SHARE = 0.8  # of a square, for an arrow as long as the ruler
_FEWEST_POINTS = 3  # whose mean is drawn: of fewer it is the noise of single points
_ARROWHEAD_PX = 4.0


def residual_map(camera: str, size_px: tuple[int, int] | None, views: Sequence[PointResiduals]) -> Figure:
    """Squares shaded by the rms of their residuals, with arrows from where points were seen towards where predicted.

    Args:
        camera: Its name.
        size_px: Its image; where not known, as far as points were seen.
        views: Its points, at least one of them used; the others are not drawn.
    """
    pixels, off = (np.concatenate([getattr(each, name)[each.used] for each in views]) for name in ("pixels", "off_px"))
    grid = image_grid(size_px, pixels)
    count = grid.sums(np.ones(len(pixels)))
    some = np.flatnonzero(count)
    rms = np.sqrt(grid.sums(np.sum(off**2, axis=-1) / 2)[some] / count[some])
    mean = np.stack([grid.sums(off[:, axis])[some] / count[some] for axis in (0, 1)], axis=-1)
    top = nice_ceiling(float(rms.max()))
    tiles = [
        grid.tile(
            int(square),
            float(value) / top,
            f"{int(number)} points, rms {two_digits(value)} px per coordinate",
        )
        for square, value, number in zip(some, rms, count[some], strict=True)
    ]
    held = count[some] >= _FEWEST_POINTS
    foot = np.stack([some % grid.shape[0] + 0.5, some // grid.shape[0] + 0.5], axis=-1)[held] * grid.pitch * grid.scale
    bar_px = nice_ceiling(float(np.max(np.linalg.norm(mean[held], axis=-1), initial=0.0)))
    longer = _ARROW_SHARE * grid.pitch * grid.scale / bar_px
    ruler = np.array([[12.0, grid.height - 12], [12 + bar_px * longer, grid.height - 12]])
    svg = grid.drawing(
        f"reprojection errors in the image of {camera}",
        "0",
        f"{top:g} px rms",
        *tiles,
        element("path", class_="arrows", d=_arrows(foot, foot + mean[held] * longer)),
        element("path", class_="ruler", d=segments([ruler])),
        element(
            "text", text(f"{bar_px:g} px"), class_="ruler-label", x=f"{ruler[1, 0] + 6:.1f}", y=f"{grid.height - 7:.1f}"
        ),
    )
    caption = (
        f"{len(pixels)} points. Shade: rms per coordinate, full at {top:g} px. Arrow: mean from where points were seen "
        f"towards where they are predicted, {three_digits(longer / grid.scale)} times as long. Arrows that agree with "
        "their neighbours are a pattern that the lens model does not have."
    )
    return Figure(f"{camera}, residuals over the image", svg, caption)


def _arrows(foot: Array, tip: Array) -> str:
    """Lines, (n, 2) to (n, 2), with heads where they are long enough to have one."""
    along = tip - foot
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    long = length[:, 0] > 2 * _ARROWHEAD_PX
    unit, end = along[long] / length[long], tip[long]
    across = np.stack([-unit[:, 1], unit[:, 0]], -1)
    back = end - _ARROWHEAD_PX * unit
    left, right = back + 0.5 * _ARROWHEAD_PX * across, back - 0.5 * _ARROWHEAD_PX * across
    heads = np.concatenate([np.stack([left, end], 1), np.stack([right, end], 1)])
    return segments(np.stack([foot, tip], 1)) + segments(heads)
