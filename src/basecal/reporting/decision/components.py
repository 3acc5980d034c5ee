"""How well each component of a position is known, beside the tolerance."""

from __future__ import annotations

from basecal.geometry import PoseEstimate
from basecal.reporting.figures.figure import Figure, rectangle
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import drawing, element, path

_WIDTH, _ROW, _LEFT, _RIGHT = 420.0, 30.0, 24.0, 100.0
_INTERVAL_SIGMAS = 1.96  # sigmas on either side, within which 95 % of normal errors are


def component_figure(name: str, estimate: PoseEstimate, tolerance_m: float | None) -> Figure:
    """A whisker for x, y and z, over the band of the tolerance if one is stated."""
    lengths = 1e3 * _INTERVAL_SIGMAS * estimate.sigma_t
    limit = None if tolerance_m is None else 1e3 * tolerance_m
    most = 1.1 * max(float(lengths.max()), limit or 0.0, 1e-9)
    middle, half = (_LEFT + _WIDTH - _RIGHT) / 2, (_WIDTH - _RIGHT - _LEFT) / 2
    height = 3 * _ROW
    allowed = half * (limit or 0.0) / most
    parts = [] if limit is None else [rectangle("allowed", (middle - allowed, 0, 2 * allowed, height))]
    parts.append(path("rule", f"M{middle:.1f} 0V{height:g}"))
    for row, (axis, length) in enumerate(zip("xyz", lengths, strict=True)):
        y, reach = _ROW * (row + 0.5), half * length / most
        kind = "beyond" if limit is not None and length > limit else "within"
        parts.append(path(f"interval {kind}", f"M{middle - reach:.1f} {y - 6}v12m0-6H{middle + reach:.1f}m0-6v12"))
        for x, words in ((6, axis), (_WIDTH - _RIGHT + 12, f"± {two_digits(length)} mm")):
            parts.append(element("text", words, x=x, y=y + 4, class_="tick"))
    also = "" if limit is None else f" Shaded: the tolerance, {limit:.3g} mm."
    caption = f"Intervals that hold 95 % of errors along each axis of {name.partition('_from_')[2]}.{also}"
    svg = drawing(_WIDTH, height, "95 % intervals by axis", *parts)
    return Figure("position by axis, 95 % intervals", svg, caption)
