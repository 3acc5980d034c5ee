"""Hypotheses with an unknown sample: where the pairing slips, and which views are read upside down.

`benchmarks.mutations` judges its limits.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.input_check.hypotheses import ConventionHypothesis, shift_hypothesis
from basecal.accuracy.input_check.loop_fit import (
    Fits,
    Lenses,
    LoopFit,
    fit_loops,
    loop_errors,
    prepare_views,
    trimmed_rms,
)
from basecal.accuracy.readings.reading import Reading
from basecal.estimation.problem.correspondence import half_turn
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.start.first_state import known_transforms
from basecal.estimation.start.metric_points import has_metric_start
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, BoolArray

_VIEWS = 24  # views of each half that are fitted
_ALL_VIEWS = 400  # views whose pairing is determined
_SLIPS = (1, -1)  # samples: one detection missed, or given twice
_MIN_HALF_SAMPLES = 6  # samples of a half, which a fit of three unknown transforms needs
_FEWEST_SLIPPED = 4  # samples at either end: fewer may be single outliers
_CLOSED_RAD = 0.005  # [rad] loop error below which a loop counts as closed
_FAR_RATIO = 4.0  # times the loop error of the best samples, at which the error of a sample is clipped
_CANDIDATES = 2  # candidates to fit; the second in case the first is its neighbour
# Alternations of the mean rotation and the turned views. Of recordings spread by half a radian, four identify 93 %
# and one 65 %.
_ALTERNATIONS = 4


def slip_hypotheses(
    baseline: Reading, lenses: Lenses, streams: list[str | None]
) -> list[tuple[ConventionHypothesis, Fits]]:
    """List the best hypotheses that one stream is shifted by one sample from some sample on, each with its fits.

    One half of the recording is paired correctly throughout, as declared or as shifted. After a fit to that half, every
    sample shows which of the two pairings it has.
    """
    length, known = len(baseline.order), known_transforms(baseline.problem)
    without_poses = any(has_metric_start(group, known) for group in baseline.problem.groups)
    if length < 2 * _MIN_HALF_SAMPLES or without_poses:  # points without a pose, such as touches, close no loop
        return []
    slips = [(stream, count) for stream in streams for count in _SLIPS]
    shifted = [baseline.shift(stream, count) for stream, count in slips]
    second_halves = [each.take(np.arange(min(length // 2, len(each.order)), len(each.order))) for each in shifted]
    first, *seconds = _fit_readings([baseline.take(np.arange(length // 2)), *second_halves], lenses)
    recorded_views = _all_views(baseline, lenses)
    scored: list[tuple[float, ConventionHypothesis, Fits]] = []
    for (stream, count), reading, second in zip(slips, shifted, seconds, strict=True):
        shifted_views = _all_views(reading, lenses)
        for fits in (first, second):
            both = recorded_views, shifted_views
            errors, shifted_errors = (_sample_errors(views, baseline, fits) for views in both)
            score, k = _find_slip(errors, shifted_errors, max(count, 0))
            scored.append((score, shift_hypothesis(stream, count, k, int(baseline.order[k])), fits))
    scored.sort(key=lambda each: each[0])
    return [(hypothesis, fits) for _, hypothesis, fits in scored[:_CANDIDATES]]


def _fit_readings(readings: list[Reading], lenses: Lenses) -> list[Fits]:
    """Fits of the pairs of camera and target of each reading, as one batch."""
    pairs = []
    for k, reading in enumerate(readings):
        problem = reading.thin(_VIEWS).problem
        for g in problem.groups:
            pairs.append((k, (g.camera, g.target), prepare_views(g, lenses.get(g.camera), _VIEWS), problem))
    found: list[dict[tuple[str, str], LoopFit]] = [{} for _ in readings]
    fits = fit_loops([(sight, problem) for *_, sight, problem in pairs])
    for (k, key, *_), fit in zip(pairs, fits, strict=True):
        if fit is not None:
            found[k][key] = fit
    return [*found]


def _all_views(reading: Reading, lenses: Lenses) -> list[PairViews]:
    """All views of each pair of camera and target."""
    return [prepare_views(g, lenses.get(g.camera), _ALL_VIEWS) for g in reading.problem.groups]


def _find_slip(errors: Array, shifted_errors: Array, lost_count: int) -> tuple[float, int]:
    """Smallest RMS error if the pairing changes at one position and loses samples there, and that position.

    A few samples at either end may be single outliers, so that the pairing never changes there.
    """
    limit = _FAR_RATIO * max(min(trimmed_rms(errors, 0.4), trimmed_rms(shifted_errors, 0.4)), _CLOSED_RAD)
    errors, shifted_errors = (np.minimum(np.nan_to_num(off, nan=limit), limit) ** 2 for off in (errors, shifted_errors))
    until = np.cumsum(np.append(0.0, errors))
    since = np.concatenate([np.cumsum(shifted_errors[::-1])[::-1], np.zeros(1 + lost_count)])[lost_count:]
    total = until + since
    k = _FEWEST_SLIPPED + int(np.argmin(total[_FEWEST_SLIPPED:-_FEWEST_SLIPPED]))
    return float(np.sqrt(total[k] / len(errors))), k


def _sample_errors(views: list[PairViews], baseline: Reading, fits: Fits) -> Array:
    """RMS error of the views of each sample of the declared reading, (m,); NaN if a sample has no view."""
    squares: dict[int, list[float]] = {}
    for sight in views:
        fit = fits.get((sight.group.camera, sight.group.target))
        if fit is not None:
            for number, off in zip(sight.group.sample.tolist(), loop_errors(sight, fit.triple).tolist(), strict=True):
                squares.setdefault(number, []).append(off**2)
    return np.array([np.sqrt(np.mean(squares.get(number, [np.nan]))) for number in baseline.order.tolist()])


def half_turn_hypotheses(baseline: Reading) -> list[ConventionHypothesis]:
    """Hypotheses that some observed poses of a symmetric grid are rotated by half a turn.

    All views of a camera are brought to the same end of the grid, by their rotations relative to each other.
    """
    found = []
    for group in baseline.problem.groups:
        shape, seen = baseline.cell.targets[group.target].target, group.measurement
        turn = None if shape is None else half_turn(shape)
        if turn is None or len(group) < _MIN_HALF_SAMPLES or not isinstance(seen, PoseMeasurement):
            continue
        poses = seen.measured_camera_from_target
        flipped = _is_nearer_turned(poses, poses @ turn)
        if np.any(flipped) and not np.all(flipped):
            found += [_half_turn_hypothesis(group, turn, mask) for mask in (flipped, ~flipped)]
    return found


def _is_nearer_turned(poses: SE3, turned_poses: SE3) -> BoolArray:
    """Whether each view is nearer to the others when rotated by half a turn, (n,)."""
    flip = np.zeros(len(poses), dtype=bool)
    mean = poses.rotation[0]
    for _ in range(_ALTERNATIONS):
        flip = np.einsum("nij,ij->n", turned_poses.rotation - poses.rotation, mean) > 0
        mean = np.where(flip[:, None, None], turned_poses.rotation, poses.rotation).sum(0)
    return flip


def _half_turn_hypothesis(group: ViewGroup, turn: SE3, mask: BoolArray) -> ConventionHypothesis:
    name, numbers = group.target, group.sample[mask].tolist()
    shown = ", ".join(map(str, numbers[:10])) + (", ..." if len(numbers) > 10 else "")

    def turn_group(view_group: ViewGroup) -> ViewGroup:
        """Rotate the views of the chosen samples by half a turn of the target."""
        seen = view_group.measurement
        if not isinstance(seen, PoseMeasurement) or (view_group.camera, view_group.target) != (group.camera, name):
            return view_group
        poses, is_chosen = seen.measured_camera_from_target, np.isin(view_group.sample, numbers)[:, None]
        turned = poses @ turn
        rotation = np.where(is_chosen[..., None], turned.rotation, poses.rotation)
        mapped = SE3(rotation, np.where(is_chosen, turned.translation, poses.translation))
        return replace(view_group, measurement=replace(seen, measured_camera_from_target=mapped))

    return ConventionHypothesis(
        "board-symmetry",
        (name, *map(str, numbers)),
        f"the observed poses of {name} are rotated by half a turn at sample {shown}: read from the grid's other end",
        "rotate these poses by half a turn, or use a target without symmetry",
        "use a target without symmetry",
        lambda reading: reading.map_groups(turn_group),
    )
