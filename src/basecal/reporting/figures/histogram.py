"""Residuals as a histogram."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.geometry import Array
from basecal.reporting.figures.figure import BAR, HEIGHT, Figure, bar
from basecal.reporting.svg import drawing, element, nice_ceiling

_BINS = 41
_BIN_RANGE_RMS = 4.0


def histogram(seen: Sequence[PointResiduals]) -> Figure:
    """Both coordinates' residuals of points that were used, beside the normal distribution of the same rms."""
    off = np.concatenate([each.off_px[each.used].ravel() for each in seen])
    rms = float(np.sqrt(np.mean(off**2)))
    limit = nice_ceiling(_BIN_RANGE_RMS * rms)
    edges = np.linspace(-limit, limit, _BINS + 1)
    counts = np.histogram(np.clip(off, -limit, limit), edges)[0]
    normal = len(off) * _normal(edges, rms)
    top = max(float(counts.max()), float(normal.max()))
    bars = [
        bar(k * BAR, BAR, count / top, f"{edges[k]:.3g} to {edges[k + 1]:.3g} px: {count}")
        for k, count in enumerate(counts.tolist())
        if count
    ]
    curve = "L".join(f"{(k + 0.5) * BAR:g} {HEIGHT * (1 - share):.2f}" for k, share in enumerate(normal / top))
    line = element("path", class_="curve", d=f"M{curve}", vector_effect="non-scaling-stroke")
    svg = drawing(_BINS * BAR, HEIGHT, "histogram of residuals", *bars, line, stretch=True)
    outside = int(np.count_nonzero(np.abs(off) > limit))
    ends = f" {outside} beyond the ends stand in the outermost bars." if outside else ""
    caption = (
        f"{len(off)} coordinates, predicted minus seen; the line is the normal distribution of the same rms.{ends}"
    )
    labels = (f"{-limit:g}", f"{-limit / 2:g}", "0", f"{limit / 2:g}", f"{limit:g} px")
    return Figure("all residuals", svg, caption, labels)


def _normal(edges: Array, rms: float) -> Array:
    """Share of each bin in a normal distribution, by the density at its middle; zero without any spread."""
    if rms == 0:
        return np.zeros(len(edges) - 1)
    middle = 0.5 * (edges[1:] + edges[:-1]) / rms
    share: Array = np.diff(edges) / rms * np.exp(-0.5 * middle**2) / np.sqrt(2 * np.pi)
    return share
