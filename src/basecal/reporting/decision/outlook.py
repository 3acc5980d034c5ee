"""The expected error over the number of samples, with the tolerance."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.reporting.figures.curves import Band, curves
from basecal.reporting.figures.figure import Figure
from basecal.reporting.statement.digits import two_digits


def outlook_figure(outlook: Sequence[tuple[int, float]], recorded_count: int, tolerance_m: float | None) -> Figure:
    """A line over the samples recorded and so many more planned ones, (count, error [m]) each."""
    points = [(recorded_count + count, length) for count, length in outlook]
    return error_curve("expected error at the task, 95 %, with more samples", points, tolerance_m)


def error_curve(title: str, points: Sequence[tuple[int, float]], tolerance_m: float | None) -> Figure:
    """A line over numbers of samples, (count, error [m]) each, with the tolerance."""
    limit = None if tolerance_m is None else 1e3 * tolerance_m
    bands = [Band(count, (1e3 * length,) * 3) for count, length in points]
    svg = curves(title, "samples", "mm", {title: bands}, limit, logarithmic=False)
    also = "" if limit is None else f" Dashed: the tolerance, {limit:.3g} mm."
    said = ", ".join(f"{two_digits(1e3 * length)} mm with {count}" for count, length in (points[0], *points[-1:]))
    return Figure(f"{title} [mm]", svg, f"{said} samples.{also}")
