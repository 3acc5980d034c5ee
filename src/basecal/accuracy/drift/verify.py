"""Verify a calibrated cell with new samples: detect a shift, its cause, and the smallest detectable shift.

`benchmarks.verify` evaluates the limits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.drift.innovations import Innovations, innovations
from basecal.accuracy.drift.shifts import Shift, detectable_m, frame_shifts, joint_shifts
from basecal.accuracy.model_comparison.nested_models import MOVED, equally_likely
from basecal.cell import Calibration, Cell, Recording
from basecal.errors import InputError, check_type, list_names
from basecal.estimation.streams.streams import synchronous_recording
from basecal.geometry import Array
from basecal.numerics.spectral import scaled_spectrum, spectrum
from basecal.numerics.threads import limit_threads

POWER = 0.95
"""Probability that a shift of the detectable length is detected."""

_FEWEST_SAMPLES = 4  # smallest number of samples of which one may be an outlier
_LARGEST_DETECTABLE_M = (
    0.1  # [m] of the detectable shift: if it is larger, predictions are too uncertain for a first-order analysis
)
_UNCHANGED_CHANCE = 0.05  # p-value of the other samples above which they agree with the calibration


@dataclass(frozen=True, eq=False)
class Verification:
    """The result of comparing new samples with a calibration.

    Attributes:
        moved: Whether something moved; None if the samples or the calibration have too little information.
        chance: p-value if nothing moved, by Bonferroni: the smallest of all frames times their number.
        shift: The most likely shift, even if it is not significant; None if nothing can be compared.
        alternatives: Other shifts that explain the samples about equally well, if something moved.
        detectable_m: Shift that is detected with probability `POWER` for each calibrated transform [m]; None if there
            is no such shift.
        samples: Numbers of the compared samples.
        outliers: Numbers of single samples that disagree with all others, and were left out.
        asked: Estimated shift of each calibrated transform, even if it is not significant.
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
        """Summary of the result in one line."""
        frame = "" if self.shift is None else f" {self.shift.frame}"
        state = "undecided" if self.moved is None else f"moved:{frame}" if self.moved else "not moved"
        return f"<{state}, {len(self.samples)} samples, p = {self.chance:.2g}>"


@limit_threads
def verify(cell: Cell, calibration: Calibration, recording: Recording) -> Verification:
    """Compare new samples of a cell with its calibration.

    Args:
        cell: The calibrated cell.
        calibration: Its calibration.
        recording: The new samples, one or more, with observations from `detect`.

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
    of = innovations(cell, calibration, synchronous_recording(cell, recording, calibration))
    found = _verify(cell, of)
    if found.shift is not None and len(found.samples) >= FEWEST_SAMPLES:
        of = with_shared_errors(of, found.shift)
        found = _verify(cell, of)
    if not found.moved or len(found.samples) < _FEWEST_SAMPLES:
        return found
    # A single sample that disagrees is an outlier: a real shift affects all later samples.
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
"""Smallest number of samples whose scatter is informative, with six values each."""

_HIDDEN_SHARE = 1e-9  # share of the information below which a direction of a camera's pose is unobservable


def with_shared_errors(innovations: Innovations, shift: Shift) -> Innovations:
    """Return a copy with errors that the views of each camera share at each sample, estimated from the samples.

    Views count as independent, except for the errors of robots and the uncertainty of the calibration. The views of one
    camera may share further errors: a small lens error at the targets' positions, image blur, or a shaking stand. With
    many samples, the estimates of the camera's pose then scatter by more than their covariance. If the excess is
    significant, it is added to the uncertainty of the camera's pose, in new and in calibrated samples.
    Source: the covariance of estimates from clusters, Liang & Zeger 1986; the largest eigenvalue of noise, Marchenko &
    Pastur 1967; docs/mathematics.md (13.5).

    Args:
        innovations: New views, of `FEWEST_SAMPLES` or more.
        shift: The likeliest shift, which is removed from the residuals.
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
    """Covariance of all views from the shared errors of one camera's views, (6 n, 6 n).

    Args:
        innovations: The views.
        place_jacobian: (6 n, 6) derivative of the innovations with respect to the camera's pose.
        residual: (6 n,) residuals multiplied by the inverse of their covariance.
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
