"""Drift of transforms over days, from the shifts that verifications measured.

All verifications of one run share the error of that run. A line with a free offset is therefore fitted, and only its
slope shows drift. Source: weighted least squares; docs/mathematics.md (13.4).
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
"""Smallest number of verifications of a run for a slope: two always lie on a line."""

_DAY_S = 86400.0
_LEAST_DAYS = 1e-3  # smallest time from the first to the last verification for a slope [days]


@dataclass(frozen=True, eq=False)
class Drift:
    """Drift rate of a transform, from the verifications of one run.

    Attributes:
        transform: Name of the transform.
        run: Name of the run.
        count: Number of verifications.
        m_per_day: (3,) drift rate along the axes of the transform [m/day].
        sigma: (3,) sigma of the drift rate [m/day].
        chance: p-value of the drift rate if nothing drifts.
    """

    transform: str
    run: str
    count: int
    m_per_day: Array
    sigma: Array
    chance: float


def record_verification(verification: Verification, time: datetime, run_name: str) -> PastVerification:
    """Return the record of a verification of a run."""
    shifts = {
        each.transform: MeasuredShift(each.size[:3], np.sqrt(np.maximum(np.diag(each.covariance)[:3], 0.0)))
        for each in verification.requested
    }
    frame = verification.shift.frame if verification.moved and verification.shift is not None else None
    samples = len(verification.samples)
    return PastVerification(
        time, run_name, samples, verification.moved, verification.chance, verification.detectable_m, frame, shifts
    )


def drifts(history: Sequence[PastVerification]) -> tuple[Drift, ...]:
    """Drift of each transform, from all verifications of the run that was verified last."""
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
