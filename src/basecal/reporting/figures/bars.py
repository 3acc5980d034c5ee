"""A bar for each view by its sample."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from basecal.cell import SampleResidual
from basecal.reporting.figures.figure import BAR, HEIGHT, Figure, bar
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import drawing, element, nice_ceiling


@dataclass(frozen=True)
class Quantity:
    """A quantity of bars of views: the field of `SampleResidual`, its factor to `unit`, and its name."""

    name: str
    field: str
    factor: float
    unit: str


QUANTITIES = (
    Quantity("reprojection error, rms", "rms_px", 1.0, "px"),
    Quantity("pose consistency error, length", "loop_m", 1e3, "mm"),
    Quantity("pose consistency error, angle", "loop_rad", float(np.degrees(1)), "deg"),
)


def bar_figure(
    views: Sequence[SampleResidual], quantity: Quantity, max_count: int, left_out: Collection[SampleResidual] = ()
) -> Figure | None:
    """A bar for each view by sample, of more than `max_count` the largest; None if no view has the quantity.

    Those left out are marked; they are in no mean, and their bars end with the figure.
    """
    given = [view for view in views if getattr(view, quantity.field) is not None]
    if not given:
        return None
    largest = sorted(range(len(given)), key=lambda k: -getattr(given[k], quantity.field))[:max_count]
    shown = [given[k] for k in sorted(largest)]
    value = {id(view): getattr(view, quantity.field) * quantity.factor for view in given}
    used = [value[id(view)] for view in given if view not in left_out] or list(value.values())
    rms = float(np.sqrt(np.mean(np.square(used))))
    top = nice_ceiling(max(used))
    bars = []
    for place, view in enumerate(shown):
        state, kind = (", left out", "view stranger") if view in left_out else ("", "view")
        label = f"sample {view.sample}: {two_digits(value[id(view)])} {quantity.unit}{state}"
        bars.append(bar(place * BAR, BAR, value[id(view)] / top, label, view.sample, kind))
    level = f"M0 {HEIGHT * (1 - rms / top):.2f}H{len(shown) * BAR:g}"
    line = element("path", class_="level", d=level, vector_effect="non-scaling-stroke")
    svg = drawing(len(shown) * BAR, HEIGHT, f"{quantity.name} by view", *bars, line, stretch=True)
    worst = f"the {len(shown)} largest of {len(given)} views; " if len(shown) < len(given) else ""
    strangers = "; orange: left out" if any(view in left_out for view in shown) else ""
    caption = f"{worst}dashed: rms over the views used, {two_digits(rms)} {quantity.unit}{strangers}"
    first, last = shown[0].sample, shown[-1].sample
    ends = (f"sample {first}", f"{last}") if len(shown) > 1 else (f"sample {first}",)
    return Figure(quantity.name, svg, caption, ends, (f"{top:g} {quantity.unit}", f"{top / 2:g}", "0"))
