"""Agreement of new samples with their predictions by previous samples, and the single cause of a disagreement.

The squared deviation of new views from their prediction is chi-square with the views' degrees of freedom. If the noise
is estimated with n degrees of freedom, it has an F distribution. Source: docs/mathematics.md (13.1), (13.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.drift.innovations import Innovations, innovations
from basecal.accuracy.drift.shifts import Shift, frame_shifts, joint_shifts, size_shifts
from basecal.accuracy.model_comparison.nested_models import DISAGREEMENT_LEVEL, equally_likely, log_chance
from basecal.cell import Calibration, Cell, Recording
from basecal.geometry import SE3


@dataclass(frozen=True, eq=False)
class Disagreement:
    """Comparison of new samples with a calibration.

    Attributes:
        chance: p-value of the samples' deviation, under noise alone.
        causes: Possible shifts that explain the samples about equally well, the likeliest first. Empty if `chance` is
            above `DISAGREEMENT_LEVEL`.
        chance_left: p-value of the deviation that remains with the likeliest cause.
    """

    chance: float
    causes: tuple[Shift, ...]
    chance_left: float


def disagreement(cell: Cell, calibration: Calibration, recording: Recording) -> Disagreement | None:
    """Compare new samples with a calibration; None if the calibration predicts none of them.

    Raises:
        InputError: if the cell contradicts the recording.
    """
    observed = innovations(cell, calibration, recording)
    freedoms = int((np.abs(observed.root).max(axis=-2) > 0).sum())
    if not freedoms:
        return None
    total = _chi_square(observed)
    chance = _chance(observed, total, freedoms)
    if chance > DISAGREEMENT_LEVEL:
        return Disagreement(chance, (), chance)
    frames = [_relinearise(cell, calibration, recording, shift) for shift in frame_shifts(observed)]
    others = [
        (shift, _chi_square(observed) - shift.statistic) for shift in (*size_shifts(observed), *joint_shifts(observed))
    ]
    causes = sorted([*frames, *others], key=lambda each: _cost(*each))
    best, left = causes[0]
    likely = tuple(causes[k][0] for k in equally_likely([_cost(*each) for each in causes]))
    return Disagreement(chance, likely, _chance(observed, max(left, 0.0), freedoms - best.freedoms))


def _relinearise(cell: Cell, calibration: Calibration, recording: Recording, shift: Shift) -> tuple[Shift, float]:
    """Linearise again about a frame's shift; return the refined shift and the remaining squared deviation."""
    before = calibration.transforms[shift.transform]
    mean = before.mean @ SE3.exp(shift.size)
    moved = replace(calibration, transforms={**calibration.transforms, shift.transform: replace(before, mean=mean)})
    refined = innovations(cell, moved, recording)
    rest = next(each for each in frame_shifts(refined) if each.transform == shift.transform)
    size = (SE3.exp(shift.size) @ SE3.exp(rest.size)).log()
    return replace(shift, size=size), _chi_square(refined) - rest.statistic


def _chi_square(innovations: Innovations) -> float:
    return float(innovations.deviation @ innovations.covariance_inverse @ innovations.deviation)


def _cost(shift: Shift, chi_square: float) -> float:
    """Remaining chi-square under a cause, plus its degrees of freedom, the mean decrease by chance."""
    return chi_square + shift.freedoms


def _chance(innovations: Innovations, statistic: float, freedoms: int) -> float:
    return float(np.exp(log_chance(statistic, freedoms, innovations.noise_freedoms)))
