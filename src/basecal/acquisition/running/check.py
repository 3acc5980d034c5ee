"""The running check: comparison of each sample with the prediction from earlier samples.

A sample that disagrees is held back until the next sample. If the next sample agrees, the image of the first one
belongs to another pose. If one shift explains both samples, something moved. Systematic errors of the whole recording,
such as a joint offset, are reported if two consecutive checks find them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.drift.disagreement import Disagreement, disagreement
from basecal.accuracy.drift.shifts import SIZE_KIND, Shift
from basecal.accuracy.model_comparison.nested_models import CONFIRMED_LEVEL
from basecal.acquisition.running.estimate import RunningEstimate, running_estimate
from basecal.cell import Cell, Recording, Sample
from basecal.effects.faces.effect import FoundEffect
from basecal.effects.registry import describe_effect
from basecal.fields.digits import p_value_text, two_digits

_WINDOW_SAMPLES = 3  # samples that are tested together, for effects too small for one sample
_EXPLAINED = 1e-3  # p-value of the remaining residuals above which a cause explains the samples
_REPORTED = {"base-moved", "robot-model", "length-scale"}
_MOST_CAUSES = 3  # largest number of reported causes if several explain the samples equally


@dataclass(frozen=True)
class Doubt:
    """A disagreement between a sample and earlier samples.

    Attributes:
        sample: Number of the first sample that disagrees.
        message: The disagreement, its cause, and what to do.
        is_lasting: Whether the cause also affects the following samples.
        repeats: Whether to take the sample again at the same place.
    """

    sample: int
    message: str
    is_lasting: bool
    repeats: bool = False


class RunningCheck:
    """Sequential check of the samples of a capture.

    Attributes:
        estimate: Estimate from the samples that agree; None before there are enough.
    """

    def __init__(self, cell: Cell) -> None:
        self.estimate: RunningEstimate | None = None
        self._cell = cell
        self._agreeing: list[Sample] = []
        self._pending: list[Sample] = []
        self._earlier_estimates: deque[RunningEstimate | None] = deque(maxlen=_WINDOW_SAMPLES)
        self._suspected: tuple[str, ...] = ()
        self._reported: set[tuple[str, ...]] = set()

    def add(self, sample: Sample) -> tuple[Doubt, ...]:
        """Add a sample; the new disagreements."""
        doubts = self._compare(sample) if sample.observations else ()
        if not self._pending:
            self._earlier_estimates.append(self.estimate)
            self.estimate = running_estimate(self._cell, self._agreeing, self.estimate) or self.estimate
            doubts = (*doubts, *self._systematic_doubts())
        return doubts

    def _compare(self, sample: Sample) -> tuple[Doubt, ...]:
        """Test a sample against the estimate before it; add it to the agreeing samples, or hold it back."""
        alone = self._disagreement(self.estimate, [sample])
        if alone is None or alone.chance > CONFIRMED_LEVEL:
            odd_samples, self._pending = self._pending, []
            self._agreeing.append(sample)
            return (*map(_odd_sample, odd_samples), *self._test_window())
        self._pending.append(sample)
        if len(self._pending) == 1:
            return (_first_doubt(sample, alone),)
        return self._judge_pending(alone)

    def _judge_pending(self, disagreement: Disagreement) -> tuple[Doubt, ...]:
        """Test whether one shift explains all samples held back; else the earlier ones are odd samples."""
        held, self._pending = self._pending, []
        joint = self._disagreement(self.estimate, held)
        if joint is None or joint.chance_left < _EXPLAINED:
            self._pending = held[-1:]
            return tuple(map(_odd_sample, held[:-1]))
        self._agreeing += held
        return self._report_move(held[0].sample, joint)

    def _test_window(self) -> tuple[Doubt, ...]:
        """Test the last samples together against the estimate before them."""
        if len(self._earlier_estimates) < _WINDOW_SAMPLES:
            return ()
        recent = self._agreeing[-_WINDOW_SAMPLES:]
        found = self._disagreement(self._earlier_estimates[1 - _WINDOW_SAMPLES], recent)
        if found is None or found.chance > CONFIRMED_LEVEL or found.chance_left < _EXPLAINED:
            return ()
        return self._report_move(recent[0].sample, found)

    def _report_move(self, sample: int, shift: Disagreement) -> tuple[Doubt, ...]:
        return self._report_new(("moved",), Doubt(sample, cause_of_shifts(shift.causes, sample), is_lasting=True))

    def _systematic_doubts(self) -> tuple[Doubt, ...]:
        """The systematic error that both this check and the previous one found."""
        error = None if self.estimate is None else self.estimate.error
        previous, self._suspected = self._suspected, _error_key(error)
        cause = None if error is None or not error.is_certain else cause_of_error(error)
        if error is None or cause is None or previous != self._suspected:
            return ()
        if error.since is None:
            return self._report_new(previous, Doubt(self._agreeing[-1].sample, cause, is_lasting=True))
        return self._report_new(("moved",), Doubt(error.since, cause, is_lasting=True))

    def _report_new(self, kind: tuple[str, ...], doubt: Doubt) -> tuple[Doubt, ...]:
        if kind in self._reported:
            return ()
        self._reported.add(kind)
        return (doubt,)

    def _disagreement(self, estimate: RunningEstimate | None, samples: Sequence[Sample]) -> Disagreement | None:
        if estimate is None or ("moved",) in self._reported:
            return None
        return disagreement(self._cell, estimate.calibration, Recording(tuple(samples)))


def _error_key(error: FoundEffect | None) -> tuple[str, ...]:
    """Kind of a systematic error and its object; effects of one arm alternate while samples are too few."""
    return () if error is None else (describe_effect(error).code, error.about)


def _first_doubt(sample: Sample, single: Disagreement) -> Doubt:
    """The doubt about a sample that disagrees, before the next sample shows the cause."""
    message = (
        f"Sample {sample.sample} disagrees with the samples before it ({p_value_text(single.chance, 1)}). Its image "
        f"and its pose do not belong together, or {cause_of_shifts(single.causes, sample.sample)}"
    )
    return Doubt(sample.sample, message, is_lasting=False, repeats=True)


def _odd_sample(sample: Sample) -> Doubt:
    """The doubt about a sample that disagrees while its predecessors and successors agree."""
    message = f"The image of sample {sample.sample} does not belong to its pose. Check the stamps of its camera."
    return Doubt(sample.sample, message, is_lasting=False)


def cause_of_shifts(causes: Sequence[Shift], sample: int) -> str:
    """Message about a shift at a sample, and the remedy.

    Args:
        causes: Shifts that explain the samples, the likeliest first.
        sample: Number of the first affected sample.
    """
    named = list(dict.fromkeys(_describe_shift(each, sample) for each in causes))[:_MOST_CAUSES]
    return f"{', or '.join(named)}. Check what was bumped, loosened or exchanged, and capture again."


def _describe_shift(cause: Shift, sample: int) -> str:
    angle = f"{two_digits(np.degrees(cause.shift_rad))} deg"
    if cause.joint is not None:
        robot = cause.frame.removesuffix("_flange")
        return f"joint {cause.joint + 1} of {robot} slipped by {angle} at sample {sample}"
    if cause.transform == SIZE_KIND:
        percent = 100 * float(cause.size[0])
        larger = "larger" if percent > 0 else "smaller"
        return f"{cause.frame} is another target since sample {sample}, {abs(percent):.2g} % {larger}"
    size = f"{two_digits(1e3 * cause.shift_m)} mm and {angle}"
    change = "moved" if cause.frame.endswith("_base") else "was remounted or moved"
    return f"{cause.frame} {change} at sample {sample} by {size}"


def cause_of_error(error: FoundEffect) -> str | None:
    """Message about a systematic error, and the remedy; None for errors that only the final report judges."""
    words = describe_effect(replace(error, about=error.about.rpartition("_from_")[2]))
    return f"{words.what} {words.do[0]}" if words.code in _REPORTED else None
