"""Residuals by their direction and length."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.rings import place_on_rings, polar_drawing
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import dots, element, nice_ceiling

_MOST_DOTS = 1500  # dots: more only cover one another
_RANGE_RMS = 2.5  # of the length: of normal residuals one in five hundred is longer
_HALF, _MOST_OF = 50, 95  # percent of residuals within


def residual_polar(camera: str, views: Sequence[PointResiduals]) -> Figure:
    """A dot for each point, from where it was seen in the middle to where it is predicted.

    Args:
        camera: Its name.
        views: Its points, at least one of them used.
    """
    used = np.concatenate([each.used for each in views])
    every = np.concatenate([each.off_px for each in views])
    off, left_out = every[used], every[~used]
    length = np.linalg.norm(off, axis=-1)
    top = nice_ceiling(_RANGE_RMS * float(np.sqrt(np.mean(length**2))))
    shown = off[:: -(-len(off) // _MOST_DOTS)]
    cloud = element("path", class_="cloud", d=dots(place_on_rings(shown, top)))
    strangers = element("path", class_="left-out", d=dots(place_on_rings(left_out[:_MOST_DOTS], top)))
    rings = [(share, f"{share * top:.3g} px") for share in (0.5, 1.0)]
    svg = polar_drawing(f"reprojection errors of {camera} by direction", rings, cloud, strangers)
    half, most = (two_digits(value) for value in np.percentile(length, [_HALF, _MOST_OF]))
    beyond = int(np.count_nonzero(length > top))
    outside = f" {beyond} are longer and stand on the outer ring." if beyond else ""
    also = f" {len(left_out)} orange ones were left out." if len(left_out) else ""
    few = f"{len(shown)} of {len(off)} points drawn. " if len(shown) < len(off) else ""
    caption = (
        f"{few}{_HALF} % are below {half} px, {_MOST_OF} % below {most} px.{outside}{also} A cloud that is not "
        "round and centred: a shared error."
    )
    return Figure(f"{camera}, residuals by direction", svg, caption)
