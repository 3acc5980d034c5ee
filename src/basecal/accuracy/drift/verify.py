"""Whether a cell is still as it was calibrated, what moved if it is not, and what would have been seen.

`benchmarks.verify` judges its limits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.accuracy.drift.innovations import Innovations, innovations
from basecal.accuracy.drift.shared_errors import FEWEST_SAMPLES, with_shared_errors
from basecal.accuracy.drift.shifts import Shift, detectable_m, frame_shifts, joint_shifts
from basecal.accuracy.model_comparison.nested_models import MOVED, equally_likely
from basecal.cell import Calibration, Cell, Recording
from basecal.errors import InputError, check_type, list_names
from basecal.estimation.streams.streams import synchronous
from basecal.numerics.threads import limit_threads

POWER = 0.95
"""The chance by which a shift of the length that is given as detectable is seen."""

_FEWEST_SAMPLES = 4  # samples of which one may be the odd one out
_LARGEST_DETECTABLE_M = (
    0.1  # of the shift that would be seen: where it is larger, predictions are too uncertain for first order
)
_UNCHANGED_CHANCE = 0.05  # chance of the others, above which they are as calibrated without it


@dataclass(frozen=True, eq=False)
class Verification:
    """The result of new samples against a calibration.

    Attributes:
        moved: Whether something did; None if undecided, as the samples or the calibration have too little information.
        chance: Bound of that of samples so far off where nothing moved: the least of all frames times their number.
        shift: The most likely thing to have moved, whether it did or not; None where nothing is compared.
        alternatives: Others that explain the samples about as well, where something moved.
        detectable_m: The shift of what was calibrated that would be seen with the chance `POWER` [m]; None where none.
        samples: Numbers of the samples that were compared.
        outliers: Numbers of samples that alone are off, and were left out.
        asked: What each transform that was calibrated seems to have moved by, whether it did or not.
    """

    moved: bool | None
    chance: float
    shift: Shift | None
    alternatives: tuple[Shift, ...]
    detectable_m: float | None
    samples: tuple[int, ...]
    outliers: tuple[int, ...] = ()
    asked: tuple[Shift, ...] = ()

    def __repr__(self) -> str:
        """One line."""
        frame = "" if self.shift is None else f" {self.shift.frame}"
        state = "undecided" if self.moved is None else f"moved:{frame}" if self.moved else "not moved"
        return f"<{state}, {len(self.samples)} samples, p = {self.chance:.2g}>"


@limit_threads
def verify(cell: Cell, calibration: Calibration, recording: Recording) -> Verification:
    """New samples of a cell against its calibration.

    Args:
        cell: What was calibrated.
        calibration: What came out.
        recording: The new samples, one or more; what images show is found by `detect`.

    Raises:
        InputError: if an argument is of another type, the cell contradicts the recording, or poses of a target are
            up to scale.
    """
    check_type("cell", cell, Cell)
    check_type("calibration", calibration, Calibration)
    check_type("recording", recording, Recording)
    free = [name for name, target in cell.targets.items() if target.has_free_scale]
    if free:
        raise InputError(f"poses of {list_names(free)} are up to scale: verify needs a target whose size is known")
    of = innovations(cell, calibration, synchronous(cell, recording, calibration))
    found = _verify(cell, of)
    if found.shift is not None and len(found.samples) >= FEWEST_SAMPLES:
        of = with_shared_errors(of, found.shift)
        found = _verify(cell, of)
    if not found.moved or len(found.samples) < _FEWEST_SAMPLES:
        return found
    # One sample that is off alone is a bad sample: what moved is off in all that come after.
    others = [(sample, _verify(cell, of.drop_sample(sample))) for sample in found.samples]
    sample, rest = max(others, key=lambda each: each[1].chance)
    return found if rest.chance < _UNCHANGED_CHANCE else Verification(**{**vars(rest), "outliers": (sample,)})


def _verify(cell: Cell, innovations: Innovations) -> Verification:
    samples = tuple(sorted({int(sample) for sample in innovations.sample}))
    frames = list(frame_shifts(innovations))
    if not frames:
        return Verification(None, 1.0, None, (), None, samples)
    level = MOVED / len(frames)
    chance = min(1.0, len(frames) * float(np.exp(min(each.log_chance for each in frames))))
    asked = [each for each in frames if each.transform in cell.requested_transforms] or frames
    lengths = [detectable_m(each, level, POWER) for each in asked]
    seen = None if None in lengths else max(length for length in lengths if length is not None)
    moved = chance < MOVED
    explanations = sorted([*frames, *joint_shifts(innovations)], key=lambda each: each.log_chance)
    best = explanations[0]
    is_blind = seen is not None and seen > _LARGEST_DETECTABLE_M
    is_moved = None if is_blind else True if moved else None if seen is None else False
    equal = equally_likely([each.freedoms - each.statistic for each in explanations])
    others = [explanations[k] for k in equal if is_moved and explanations[k] is not best]
    return Verification(is_moved, chance, best, tuple(others), seen, samples, asked=tuple(asked))
