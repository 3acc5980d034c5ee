"""Verify a calibrated cell with new samples: detect a shift, its cause, and the smallest detectable shift.

`benchmarks.verify` evaluates the limits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.drift.innovations import Innovations, innovations
from basecal.accuracy.drift.shifts import Shift, detectable_m, frame_shifts, joint_shifts
from basecal.accuracy.model_comparison.nested_models import MOVED_LEVEL, equally_likely
from basecal.cell import Calibration, Cell, Recording
from basecal.cell.recording_check import check_recording
from basecal.errors import InputError, check_type, count_text, list_names
from basecal.estimation.streams.streams import synchronous_recording
from basecal.geometry import Array
from basecal.numerics.spectral import scaled_spectrum, spectrum
from basecal.numerics.threads import limit_threads

POWER = 0.95
"""Probability that a shift of the detectable length is detected."""

_FEWEST_WITH_OUTLIER = 4  # smallest number of samples of which one may be an outlier
# Largest detectable shift for which predictions are certain enough for a first-order analysis.
_LARGEST_DETECTABLE_M = 0.1
_UNCHANGED_CHANCE = 0.05  # p-value of the other samples above which they agree with the calibration


@dataclass(frozen=True, eq=False)
class Verification:
    """The result of comparing new samples with a calibration.

    Attributes:
        moved: Whether something moved; None if the samples or the calibration have too little information.
        chance: p-value if nothing moved, by Bonferroni: the smallest of all frames times their number.
        shift: The most likely shift, even if it is not significant; None if nothing can be compared.
        alternatives: Other shifts that explain the samples about equally well, if something moved.
        detectable_m: Shift that is detected with probability `POWER` for each of `requested` [m]; None if there is no
            such shift.
        samples: Numbers of the compared samples.
        outliers: Numbers of single samples that disagree with all others, and were left out.
        requested: Estimated shift of each requested transform, significant or not; of all frames if none is requested.
    """

    moved: bool | None
    chance: float
    shift: Shift | None
    alternatives: tuple[Shift, ...]
    detectable_m: float | None
    samples: tuple[int, ...]
    outliers: tuple[int, ...] = ()
    requested: tuple[Shift, ...] = ()

    def __repr__(self) -> str:
        """Summary of the result in one line."""
        frame = "" if self.shift is None else f" {self.shift.frame}"
        state = "undecided" if self.moved is None else f"moved:{frame}" if self.moved else "not moved"
        return f"<{state}, {count_text(len(self.samples), 'sample')}, p = {self.chance:.2g}>"


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
    check_recording(cell, recording)
    check_type("calibration", calibration, Calibration)
    free = [name for name, target in cell.targets.items() if target.has_free_scale]
    if free:
        raise InputError(f"poses of {list_names(free)} are up to scale: verify needs a target whose size is known")
    observed = innovations(cell, calibration, synchronous_recording(cell, recording, calibration))
    found = _verify(cell, observed)
    if found.shift is not None and len(found.samples) >= FEWEST_FOR_SCATTER:
        observed = with_shared_errors(observed, found.shift)
        found = _verify(cell, observed)
    if not found.moved or len(found.samples) < _FEWEST_WITH_OUTLIER:
        return found
    # A single sample that disagrees is an outlier: a real shift affects all later samples.
    others = [(sample, _verify(cell, observed.drop_sample(sample))) for sample in found.samples]
    sample, rest = max(others, key=lambda each: each[1].chance)
    return found if rest.chance < _UNCHANGED_CHANCE else replace(rest, outliers=(sample,))


def _verify(cell: Cell, innovations: Innovations) -> Verification:
    samples = tuple(sorted({int(sample) for sample in innovations.sample}))
    frames = list(frame_shifts(innovations))
    if not frames:
        return Verification(None, 1.0, None, (), None, samples)
    level = MOVED_LEVEL / len(frames)
    chance = min(1.0, len(frames) * float(np.exp(min(each.log_chance for each in frames))))
    requested = [each for each in frames if each.transform in cell.requested_transforms] or frames
    lengths = [detectable_m(each, level, POWER) for each in requested]
    detectable = None if None in lengths else max(length for length in lengths if length is not None)
    is_significant = chance < MOVED_LEVEL
    explanations = sorted([*frames, *joint_shifts(innovations)], key=lambda each: each.log_chance)
    best = explanations[0]
    is_blind = detectable is not None and detectable > _LARGEST_DETECTABLE_M
    is_moved = None if is_blind else True if is_significant else None if detectable is None else False
    equal = equally_likely([each.freedoms - each.statistic for each in explanations])
    others = [explanations[k] for k in equal if is_moved and explanations[k] is not best]
    return Verification(is_moved, chance, best, tuple(others), detectable, samples, requested=tuple(requested))


FEWEST_FOR_SCATTER = 12
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
        innovations: New views, of `FEWEST_FOR_SCATTER` or more.
        shift: The likeliest shift, which is removed from the residuals.
    """
    if shift.joint is None:
        moves = innovations.frame_jacobian(shift.transform)
    else:
        moves = innovations.joint_jacobian(shift.frame.removesuffix("_flange"))[..., shift.joint : shift.joint + 1]
    residual = innovations.covariance_inverse @ (innovations.deviation - innovations.whiten(moves) @ shift.size)
    cameras = sorted({group.eye.mount for group in innovations.situation.problem.groups})
    shared = sum(
        (
            _camera_covariance(innovations, innovations.whiten(innovations.frame_jacobian(name)), residual)
            for name in cameras
        ),
        np.zeros(innovations.predicted.shape),
    )
    return (
        innovations
        if not np.any(shared)
        else replace(innovations, predicted=innovations.predicted + shared, known_inverse=None)
    )


def _camera_covariance(innovations: Innovations, camera_jacobian: Array, residual: Array) -> Array:
    """Covariance of all views from the shared errors of one camera's views, (6 n, 6 n).

    Args:
        innovations: The views.
        camera_jacobian: (6 n, 6) derivative of the innovations with respect to the camera's pose.
        residual: (6 n,) residuals multiplied by the inverse of their covariance.
    """
    inverse = innovations.covariance_inverse
    rows = [np.flatnonzero(np.repeat(innovations.sample == number, 6)) for number in np.unique(innovations.sample)]
    scores = np.stack([camera_jacobian[own].T @ residual[own] for own in rows])
    expected = sum(
        (camera_jacobian[own].T @ inverse[np.ix_(own, own)] @ camera_jacobian[own] for own in rows), np.zeros((6, 6))
    )
    of_all = spectrum(expected, _HIDDEN_SHARE)
    by_chance = (1 + np.sqrt(camera_jacobian.shape[1] / len(rows))) ** 2
    scatter = scaled_spectrum(of_all.inverse_root.T @ (scores.T @ scores) @ of_all.inverse_root, by_chance)
    beyond = np.where(scatter.is_informative, scatter.values - 1, 0.0)
    moved = camera_jacobian @ (of_all.inverse_root @ scatter.vectors * np.sqrt(beyond))
    covariance = moved @ moved.T
    for own in rows:
        covariance[np.ix_(own, own)] *= 1 + len(rows)
    return covariance
