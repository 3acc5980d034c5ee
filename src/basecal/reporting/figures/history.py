"""Estimated shifts of transforms since a calibration, over time."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC

import numpy as np

from basecal.cell import MeasuredShift, PastVerification
from basecal.reporting.figures.curves import COLOURS, Band, curves
from basecal.reporting.svg import Figure

_MOST_VERIFICATIONS = 40  # verifications that can be distinguished on a page
_UNITS = (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0))  # of time, with their seconds
_MANY_UNITS = 10.0  # duration above which times are rounded to tenths of a unit
_FEWEST_UNITS = 2.0  # smallest duration in a unit, below which a smaller unit is used
_SIGMAS = 2.0


def history_figure(history: Sequence[PastVerification]) -> Figure | None:
    """A line for each transform of the run that was verified last; None if there is none."""
    verifications = [each for each in history if each.run == history[-1].run][-_MOST_VERIFICATIONS:]
    names = list(dict.fromkeys(name for each in verifications for name in each.shifts))[:COLOURS]
    if not names:
        return None
    seconds = [(each.when - verifications[0].when).total_seconds() for each in verifications]
    unit, size = next((each for each in _UNITS if max(seconds) >= _FEWEST_UNITS * each[1]), _UNITS[-1])
    times = [round(time / size, 1 if max(seconds) > _MANY_UNITS * size else 2) for time in seconds]
    timed = list(zip(times, verifications, strict=True))
    lines = {name: [Band(time, _length_range(each.shifts.get(name))) for time, each in timed] for name in names}
    title = "shift since the calibration"
    since = f"{unit} since {verifications[0].when.astimezone(UTC):%Y-%m-%d %H:%M} UTC"
    caption = f"{since} across, length of the shift [mm] upwards, with {_SIGMAS:g} sigma"
    return Figure(title, curves(title, unit, "mm", lines), f"{caption}; {', '.join(names)}")


def _length_range(shift: MeasuredShift | None) -> tuple[float, float, float] | None:
    """Smallest, estimated and largest length of a shift [mm]; None for no shift."""
    if shift is None:
        return None
    length, sigma = (1e3 * float(np.linalg.norm(each)) for each in (shift.t_m, shift.sigma_m))
    doubt = _SIGMAS * sigma / 3**0.5
    return max(length - doubt, 0.0), length, length + doubt
