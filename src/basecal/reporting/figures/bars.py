"""Bar charts of residuals of views."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from basecal.cell import SampleResidual
from basecal.fields.digits import two_digits
from basecal.reporting.svg import BAR, HEIGHT, Figure, bar, drawing, nice_ceiling, path


@dataclass(frozen=True)
class Quantity:
    """A quantity of a bar chart: its name, the field of `SampleResidual`, and the factor to `unit`."""

    name: str
    field: str
    factor: float
    unit: str

    def value(self, view: SampleResidual) -> float | None:
        """The quantity of a view in its unit; None if it is not defined."""
        value = getattr(view, self.field)
        return None if value is None else value * self.factor


QUANTITIES = (
    Quantity("reprojection error, rms", "rms_px", 1.0, "px"),
    Quantity("pose consistency error, length", "loop_m", 1e3, "mm"),
    Quantity("pose consistency error, angle", "loop_rad", float(np.degrees(1)), "deg"),
)


def bar_figure(
    views: Sequence[SampleResidual], quantity: Quantity, max_count: int, left_out: Collection[SampleResidual] = ()
) -> Figure | None:
    """A bar for each view by sample, only the `max_count` largest; None if no view has the quantity.

    Views that were left out are marked. They do not count for the mean and the scale, and their bars are clipped.
    """
    given = [(view, value) for view in views if (value := quantity.value(view)) is not None]
    if not given:
        return None
    least = sorted(value for _, value in given)[-max_count:][0]
    shown = [each for each in given if each[1] >= least][:max_count]
    used = [value for view, value in given if view not in left_out] or [value for _, value in given]
    rms = float(np.sqrt(np.mean(np.square(used))))
    top = nice_ceiling(max(used))
    bars = []
    for index, (view, value) in enumerate(shown):
        state, kind = (", left out", "view stranger") if view in left_out else ("", "view")
        label = f"sample {view.sample}: {two_digits(value)} {quantity.unit}{state}"
        bars.append(bar(index * BAR, BAR, value / top, label, view.sample, kind))
    width = len(shown) * BAR
    level = path("level", f"M0 {HEIGHT * (1 - rms / top):.2f}H{width:g}", vector_effect="non-scaling-stroke")
    svg = drawing(width, HEIGHT, f"{quantity.name} by view", *bars, level, stretch=True)
    worst = f"the {len(shown)} largest of {len(given)} views; " if len(shown) < len(given) else ""
    strangers = "; orange: left out" if any(view in left_out for view, _ in shown) else ""
    caption = f"{worst}dashed: rms over the views used, {two_digits(rms)} {quantity.unit}{strangers}"
    ends = (f"sample {shown[0][0].sample}", *(str(view.sample) for view, _ in shown[1:][-1:]))
    return Figure(quantity.name, svg, caption, ends, (f"{top:g} {quantity.unit}", f"{top / 2:g}", "0"))
