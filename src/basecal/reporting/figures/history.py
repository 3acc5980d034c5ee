"""How far transforms seemed to have moved since a calibration, over days."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.cell import MeasuredShift, PastVerification
from basecal.reporting.figures.curves import COLOURS, Band, Line, curves
from basecal.reporting.figures.figure import Figure

_MOST = 40  # verifications that are told apart on a page
_SIGMAS = 2.0


def history_figure(history: Sequence[PastVerification]) -> Figure | None:
    """A line for each transform, of the run that was verified last; None where there is none."""
    mine = [each for each in history if each.run == history[-1].run][-_MOST:]
    names = list(dict.fromkeys(name for each in mine for name in each.shifts))[:COLOURS]
    if not names:
        return None
    days = [round((each.when - mine[0].when).total_seconds() / 86400, 2) for each in mine]
    lines = [
        Line(name, tuple(_band(day, each.shifts.get(name)) for day, each in zip(days, mine, strict=True)))
        for name in names
    ]
    figure = curves("shift since the calibration", "days", "mm", lines)
    ends = f"{mine[0].when:%Y-%m-%d} to {mine[-1].when:%Y-%m-%d}"
    caption = f"days since {ends.partition(' ')[0]} across, length of the shift [mm] upwards, with {_SIGMAS:g} sigma"
    return replace(figure, caption=f"{caption}; {', '.join(names)}")


def _band(day: float, shift: MeasuredShift | None) -> Band:
    if shift is None:
        return Band(day, None, None, None)
    length = 1e3 * float(np.linalg.norm(shift.t_m))
    doubt = 1e3 * _SIGMAS * float(np.linalg.norm(shift.sigma_m)) / np.sqrt(3)
    return Band(day, max(length - doubt, 0.0), length, length + doubt)
