"""Whether a cell is still as it was calibrated, what moved if it is not, and what would have been seen.

`benchmarks.verify` judges its limits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.drift.innovations import Innovations, innovations
from basecal.accuracy.drift.shifts import Shift, detectable_m, frame_shifts, joint_shifts
from basecal.accuracy.model_comparison.nested_models import MOVED, equally_likely
from basecal.cell import Calibration, Cell, Recording
from basecal.errors import InputError, check_type, list_names
from basecal.estimation.streams.streams import synchronous
from basecal.geometry import Array
from basecal.numerics.spectral import scaled_spectrum, spectrum
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


FEWEST_SAMPLES = 12
"""Whose scatter tells anything: six numbers of each."""

_HIDDEN_SHARE = 1e-9  # share of the information below which a direction of a camera's place is not seen


def with_shared_errors(innovations: Innovations, shift: Shift) -> Innovations:
    """A copy with the errors that the views of each camera share at each sample, estimated from the samples.

    Views count as independent, except for the errors of robots and the uncertainty of the calibration. The views of one
    camera may share further errors: a lens that is slightly wrong at the targets' positions, image blur, or a shaking
    stand. Such errors show in many samples: their estimates of the camera's pose scatter by more than their covariance.
    If the excess is beyond chance, the camera's pose counts as uncertain by as much, in new and in calibrated samples.
    Source: the covariance of estimates from clusters, Liang & Zeger 1986; the largest eigenvalue of noise, Marchenko &
    Pastur 1967; docs/mathematics.md (13.5).

    Args:
        innovations: New views, of `FEWEST_SAMPLES` or more.
        shift: The likeliest thing to have moved, which is none of such errors.
    """
    if shift.joint is None:
        moves = innovations.frame_jacobian(shift.transform)
    else:
        moves = innovations.joint_jacobian(shift.frame.removesuffix("_flange"))[..., shift.joint : shift.joint + 1]
    left = innovations.covariance_inverse @ (innovations.off - innovations.whiten(moves) @ shift.size)
    cameras = sorted({group.eye.mount for group in innovations.situation.problem.groups})
    more = sum(
        (
            _camera_covariance(innovations, innovations.whiten(innovations.frame_jacobian(name)), left)
            for name in cameras
        ),
        np.zeros(innovations.predicted.shape),
    )
    return (
        innovations
        if not np.any(more)
        else replace(innovations, predicted=innovations.predicted + more, known_inverse=None)
    )


def _camera_covariance(innovations: Innovations, place_jacobian: Array, residual: Array) -> Array:
    """Covariance of all views of a camera by their shared errors, (6 n, 6 n).

    Args:
        innovations: The views.
        place_jacobian: (6 n, 6) how they go with the camera's place.
        residual: (6 n,) what is left of them over its covariance.
    """
    inverse = innovations.covariance_inverse
    rows = [np.flatnonzero(np.repeat(innovations.sample == number, 6)) for number in np.unique(innovations.sample)]
    said = np.stack([place_jacobian[at].T @ residual[at] for at in rows])
    expected = sum(
        (place_jacobian[at].T @ inverse[np.ix_(at, at)] @ place_jacobian[at] for at in rows), np.zeros((6, 6))
    )
    of_all = spectrum(expected, _HIDDEN_SHARE)
    by_chance = (1 + np.sqrt(place_jacobian.shape[1] / len(rows))) ** 2
    scatter = scaled_spectrum(of_all.inverse_root.T @ (said.T @ said) @ of_all.inverse_root, by_chance)
    beyond = np.where(scatter.held, scatter.values - 1, 0.0)
    moved = place_jacobian @ (of_all.inverse_root @ scatter.vectors * np.sqrt(beyond))
    together = moved @ moved.T
    for at in rows:
        together[np.ix_(at, at)] *= 1 + len(rows)
    return together
