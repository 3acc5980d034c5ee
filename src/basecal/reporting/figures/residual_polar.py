"""Residuals by their direction and length."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.rings import place_on_rings, polar_drawing
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import dots, nice_ceiling, path

_MOST_DOTS = 1500  # dots: more only cover one another
_RANGE_RMS = 2.5  # of the length: of normal residuals one in five hundred is longer
_HALF, _MOST_OF = 50, 95  # percent of residuals within


def residual_polar(points: PointResiduals) -> Figure:
    """A dot for each point of a camera, from where it was seen in the middle to where it is predicted.

    Args:
        points: Its points, at least one of them used.
    """
    off, left_out = points.off_px[points.used], points.off_px[~points.used]
    length = np.linalg.norm(off, axis=-1)
    top = nice_ceiling(_RANGE_RMS * float(np.sqrt(np.mean(length**2))))
    shown = off[:: -(-len(off) // _MOST_DOTS)]
    drawn = {"cloud": shown, "left-out": left_out[:_MOST_DOTS]}
    clouds = [path(kind, dots(place_on_rings(each, top))) for kind, each in drawn.items()]
    rings = [(share, f"{share * top:.3g} px") for share in (0.5, 1.0)]
    svg = polar_drawing(f"reprojection errors of {points.camera} by direction", rings, *clouds)
    half, most = (two_digits(value) for value in np.percentile(length, [_HALF, _MOST_OF]))
    beyond = int(np.count_nonzero(length > top))
    outside = f" {beyond} are longer and stand on the outer ring." if beyond else ""
    also = f" {len(left_out)} orange ones were left out." if len(left_out) else ""
    few = f"{len(shown)} of {len(off)} points drawn. " if len(shown) < len(off) else ""
    caption = (
        f"{few}{_HALF} % are below {half} px, {_MOST_OF} % below {most} px.{outside}{also} A cloud that is not "
        "round and centred: a shared error."
    )
    return Figure(f"{points.camera}, residuals by direction", svg, caption)
