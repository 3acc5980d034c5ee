"""A bar for each view by its sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.cell import SampleResidual
from basecal.reporting.figures.figure import BAR, HEIGHT, Figure, bar
from basecal.reporting.svg import drawing, element, round_up


@dataclass(frozen=True)
class Quantity:
    """What the bars of views show: the field of `SampleResidual`, its factor to `unit`, and its name."""

    name: str
    field: str
    factor: float
    unit: str


QUANTITIES = (
    Quantity("reprojection error, rms", "rms_px", 1.0, "px"),
    Quantity("loop-closure error, length", "loop_m", 1e3, "mm"),
    Quantity("loop-closure error, angle", "loop_rad", float(np.degrees(1)), "deg"),
)


def bar_figure(views: Sequence[SampleResidual], quantity: Quantity, most: int) -> Figure | None:
    """A bar for each view by sample, of more than `most` the largest; None where no view has the quantity."""
    given = [
        (v.sample, getattr(v, quantity.field) * quantity.factor)
        for v in views
        if getattr(v, quantity.field) is not None
    ]
    if not given:
        return None
    largest = sorted(range(len(given)), key=lambda k: -given[k][1])[:most]
    shown = [given[k] for k in sorted(largest)]
    rms = float(np.sqrt(np.mean([value**2 for _, value in given])))
    top = round_up(max(value for _, value in shown))
    bars = [
        bar(k * BAR, BAR, value / top, f"sample {sample}: {value:.3g} {quantity.unit}", sample)
        for k, (sample, value) in enumerate(shown)
    ]
    level = f"M0 {HEIGHT * (1 - rms / top):.2f}H{len(shown) * BAR:g}"
    line = element("path", class_="level", d=level, vector_effect="non-scaling-stroke")
    svg = drawing(len(shown) * BAR, HEIGHT, f"{quantity.name} by view", *bars, line, stretch=True)
    worst = f"the {len(shown)} largest of {len(given)} views; " if len(shown) < len(given) else ""
    caption = f"{worst}dashed: rms over all views, {rms:.3g} {quantity.unit}"
    ends = (f"sample {shown[0][0]}", f"{shown[-1][0]}") if len(shown) > 1 else (f"sample {shown[0][0]}",)
    return Figure(quantity.name, svg, caption, ends, (f"{top:g} {quantity.unit}", f"{top / 2:g}", "0"))
