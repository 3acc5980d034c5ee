"""Whether new samples agree with what the samples before them predict, and which single cause explains them.

The squared deviation of new views from their prediction is chi-square with as many freedoms as the views have. Where
the noise is estimated by n freedoms, it is Fisher-distributed. Source: docs/mathematics.md (13.1), (13.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.drift.innovations import Innovations, innovations
from basecal.accuracy.drift.shifts import Shift, frame_shifts, joint_shifts, size_shifts
from basecal.accuracy.model_comparison.nested_models import DISAGREES, equally_likely, log_chance
from basecal.cell import Calibration, Cell, Recording
from basecal.geometry import SE3


@dataclass(frozen=True, eq=False)
class Disagreement:
    """New samples against a calibration.

    Attributes:
        chance: Of samples so far off by noise alone.
        causes: What may have moved, the likeliest first; those that explain the samples about equally. Empty above
            `DISAGREES`.
        chance_left: Of what the likeliest cause leaves unexplained.
    """

    chance: float
    causes: tuple[Shift, ...]
    chance_left: float


def disagreement(cell: Cell, calibration: Calibration, recording: Recording) -> Disagreement | None:
    """New samples against a calibration; None where it predicts none of them.

    Raises:
        InputError: if the cell contradicts the recording.
    """
    of = innovations(cell, calibration, recording)
    freedoms = int((np.abs(of.root).max(axis=-2) > 0).sum())
    if not freedoms:
        return None
    chance = _chance(of, _total(of), freedoms)
    if chance > DISAGREES:
        return Disagreement(chance, (), chance)
    moved = [_relinearise(cell, calibration, recording, shift) for shift in frame_shifts(of)]
    others = [(shift, _total(of) - shift.statistic) for shift in (*size_shifts(of), *joint_shifts(of))]
    causes = sorted([*moved, *others], key=lambda each: _cost(*each))
    best, left = causes[0]
    likely = tuple(causes[k][0] for k in equally_likely([_cost(*each) for each in causes]))
    return Disagreement(chance, likely, _chance(of, max(left, 0.0), freedoms - best.freedoms))


def _relinearise(cell: Cell, calibration: Calibration, recording: Recording, shift: Shift) -> tuple[Shift, float]:
    """A shift of a frame about itself, and the squared deviation that it leaves."""
    before = calibration.transforms[shift.transform]
    mean = before.mean @ SE3.exp(shift.size)
    there = replace(calibration, transforms={**calibration.transforms, shift.transform: replace(before, mean=mean)})
    of = innovations(cell, there, recording)
    again = next(each for each in frame_shifts(of) if each.transform == shift.transform)
    size = (SE3.exp(shift.size) @ SE3.exp(again.size)).log()
    return replace(shift, size=size), _total(of) - again.statistic


def _total(innovations: Innovations) -> float:
    return float(innovations.off @ innovations.covariance_inverse @ innovations.off)


def _cost(shift: Shift, chi_square: float) -> float:
    """The remaining cost under a cause, and the mean cost that its freedoms remove by chance."""
    return chi_square + shift.freedoms


def _chance(innovations: Innovations, statistic: float, freedoms: int) -> float:
    return float(np.exp(log_chance(statistic, freedoms, innovations.freedoms_of_noise)))
