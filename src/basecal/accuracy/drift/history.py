"""Whether transforms drift: shifts that verifications measured, over days.

All verifications of one run share that run's own error, so that a line with a free offset is fitted. Only its slope
shows drift. Source: weighted least squares; docs/mathematics.md (13.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from basecal.accuracy.drift.verify import Verification
from basecal.accuracy.model_comparison.nested_models import compare_nested_models
from basecal.cell import MeasuredShift, PastVerification
from basecal.geometry import Array

FEWEST_VERIFICATIONS = 3
"""Verifications of a run of which a slope is told: two always lie on a line."""

_DAY_S = 86400.0
_LEAST_DAYS = 1e-3  # between the first and the last, below which nothing is told of a day


@dataclass(frozen=True, eq=False)
class Drift:
    """How fast a transform moves, by the verifications of one run.

    Attributes:
        transform: Its name.
        run_name: The run.
        count: How many verifications there are.
        m_per_day: (3,) along its axes [m/day].
        sigma: (3,) of that.
        chance: Of slopes so steep where nothing drifts.
    """

    transform: str
    run: str
    count: int
    m_per_day: Array
    sigma: Array
    chance: float


def record_verification(verification: Verification, time: datetime, run_name: str) -> PastVerification:
    """Record a verification of a run."""
    shifts = {
        each.transform: MeasuredShift(each.size[:3], np.sqrt(np.maximum(np.diag(each.covariance)[:3], 0.0)))
        for each in verification.asked
    }
    frame = verification.shift.frame if verification.moved and verification.shift is not None else None
    samples = len(verification.samples)
    return PastVerification(
        time, run_name, samples, verification.moved, verification.chance, verification.detectable_m, frame, shifts
    )


def drifts(history: Sequence[PastVerification]) -> tuple[Drift, ...]:
    """The drift of each transform, by the run that was verified last."""
    if not history:
        return ()
    run = history[-1].run
    mine = [each for each in history if each.run == run]
    names = dict.fromkeys(name for each in mine for name in each.shifts)
    found = (_drift(name, run, [each for each in mine if name in each.shifts]) for name in names)
    return tuple(drift for drift in found if drift is not None)


def _drift(name: str, run_name: str, history: Sequence[PastVerification]) -> Drift | None:
    days = np.array([each.when.timestamp() / _DAY_S for each in history])
    sigma = np.array([each.shifts[name].sigma_m for each in history])
    if len(history) < FEWEST_VERIFICATIONS or np.ptp(days) < _LEAST_DAYS or not np.all(sigma > 0):
        return None
    shift = np.array([each.shifts[name].t_m for each in history])
    weight = sigma**-2
    middle = (weight * days[:, None]).sum(0) / weight.sum(0)
    apart = days[:, None] - middle
    information = (weight * apart**2).sum(0)
    slope = (weight * apart * shift).sum(0) / information
    squared = float(np.sum(slope**2 * information))
    return Drift(name, run_name, len(history), slope, information**-0.5, compare_nested_models(squared, 3).chance)
