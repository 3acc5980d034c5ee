"""Smallest loop errors of one camera and one target: a screening that discards hypotheses.

Only fixed transforms are known, and each pair of camera and target is fitted separately. A hypothesis that closes
no loop here closes none in the whole cell either; the others are fully fitted afterwards. `benchmarks.mutations`
judges its limits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.start.closed_form import Loop, Rotations, Triple, solve_rotations, solve_translations
from basecal.estimation.start.led_search import led_search
from basecal.estimation.start.pair_views import PairViews, PoseEstimator, led_point, pair_views
from basecal.estimation.start.refinement import Refinement, refine_jointly
from basecal.estimation.start.rotation_search import (
    HOPELESS_RAD,
    KEPT_SHARE,
    refine_rotations,
    rotation_angle,
    search_rotations,
)
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.view_pose import PoseCache, view_poses
from basecal.geometry import Array, Camera, IntArray
from basecal.geometry.rotation import lengths

_MOST_POINTS = 16  # well-spread points of a view: more do not improve its pose
_LED_STARTS = {0: 1, 1: 3, 2: 6}  # grid cells to refine, by the number of unknown rotations
_LED_STEPS = 12  # iterations for each grid cell, enough to rank them


@dataclass(frozen=True, eq=False)
class LoopFit:
    """X, Y and Z of one pair of camera and target, with the loop error of each view.

    Attributes:
        triple: eye_flange_from_camera, eye_base_from_hand_base and hand_flange_from_target.
        errors: Loop error of each view, (n,) [rad]: of the angle, and of the length over the distance to the target.
        is_led: Whether only one point was fitted, such as an LED, whose position represents the target's.
    """

    triple: Triple
    errors: Array
    is_led: bool = False


Lenses = Mapping[str, Camera]
Fits = Mapping[tuple[str, str], LoopFit]
"""Loop fits by camera and target."""


def trimmed_rms(errors: Array, share: float = KEPT_SHARE) -> float:
    """RMS of the smallest errors, of the given share; infinite if there are no errors."""
    if not len(errors):
        return float("inf")
    ordered = np.sort(np.where(np.isfinite(errors), errors, np.inf))[: max(1, int(np.ceil(share * len(errors))))]
    return float(np.sqrt(np.mean(ordered**2)))


def prepare_views(
    group: ViewGroup, camera: Camera | None, max_count: int, estimate_poses: PoseEstimator = view_poses
) -> PairViews:
    """Prepare at most `max_count` views of a group."""
    return pair_views(group, camera, max_count, _MOST_POINTS, estimate_poses)


@dataclass(frozen=True, eq=False)
class ViewCache:
    """Cache of prepared views: most hypotheses concern robots and share the same pixels.

    Attributes:
        lenses: Lenses by camera.
        prepared: Prepared views by camera, target, largest number of views and the bytes of their pixels.
        poses: Poses of single views, which other pairings assign to other samples.
    """

    lenses: Lenses
    prepared: dict[tuple[str, str, int, bytes], PairViews] = field(default_factory=dict)
    poses: PoseCache = field(default_factory=PoseCache)

    def prepare(self, group: ViewGroup, max_count: int) -> PairViews:
        """Prepare at most `max_count` views of a group, from the cache if possible."""
        measurement, camera = group.measurement, self.lenses.get(group.camera)
        if not isinstance(measurement, PixelMeasurement):
            return prepare_views(group, camera, max_count)
        content = (group.sample, measurement.points_in_target, measurement.pixels, measurement.weight)
        key = (group.camera, group.target, max_count, b"".join(array.tobytes() for array in content))
        if key not in self.prepared:
            self.prepared[key] = prepare_views(group, camera, max_count, self.poses)
        views = self.prepared[key]
        kept = np.flatnonzero(np.isin(group.sample, views.group.sample))
        return replace(views, group=replace(group.take(kept), measurement=views.group.measurement))


def fit_loops(pairs: Sequence[tuple[PairViews, Problem]]) -> list[LoopFit | None]:
    """Transforms that minimise the loop errors of each pair, with only fixed transforms known.

    The pairs of all hypotheses are fitted as one batch. A fit is None if the solve fails.
    """
    first = _fit_pairs(pairs, [np.zeros(len(sight.group), dtype=np.int64) for sight, _ in pairs])
    choices = {}
    for k, ((sight, _), fit) in enumerate(zip(pairs, first, strict=True)):
        if fit is not None and sight.candidates is not None and trimmed_rms(fit.errors) < HOPELESS_RAD:
            chosen = sight.closest_pose(fit.triple)
            if np.any(chosen):
                choices[k] = chosen
    second = dict(zip(choices, _fit_pairs([pairs[k] for k in choices], list(choices.values())), strict=True))
    return [second.get(k, fit) for k, fit in enumerate(first)]


def _fit_pairs(pairs: Sequence[tuple[PairViews, Problem]], pose_indices: Sequence[IntArray]) -> list[LoopFit | None]:
    """Fits of pairs with the chosen candidate pose of each view, (n,); an LED has no candidates."""
    fits: dict[int, LoopFit | None] = {}
    loops: dict[int, Loop] = {}
    refinements: dict[int, Refinement] = {}
    for k, ((sight, problem), indices) in enumerate(zip(pairs, pose_indices, strict=True)):
        if sight.candidates is not None:
            loops[k] = _loop(sight, problem, indices)
        elif (refinement := _led_refinement(sight, problem)) is not None:
            refinements[k] = refinement
        else:
            fits[k] = None
    for k, refined in zip(refinements, refine_jointly(list(refinements.values()), _LED_STEPS), strict=True):
        fits[k] = LoopFit(refined, loop_errors(pairs[k][0], refined), is_led=True)
    for k, triple in zip(loops, _triples(list(loops.values())), strict=True):
        fits[k] = None if triple is None else LoopFit(triple, loop_errors(pairs[k][0], triple))
    return [fits[k] for k in range(len(pairs))]


def pair_state(problem: Problem, fits: Fits, cameras: Lenses) -> State | None:
    """State from the fit of the only pair of a problem; None for several pairs or an LED."""
    if len(problem.groups) != 1:
        return None
    (group,) = problem.groups
    fit = fits.get((group.camera, group.target))
    if fit is None or fit.is_led:
        return None
    x, y, z = fit.triple
    transforms = {group.eye.mount: x, group.hand.mount: z}
    if group.eye.base is None or group.hand.base is None:
        transforms |= group.placed_base(y, {}, group.frames)
    if transforms.keys() != problem.unknowns.keys():
        return None
    return State(transforms, cameras, np.zeros((len(problem.stops), 6)))


def loop_errors(sight: PairViews, triple: Triple) -> Array:
    """Loop error of each view given X, Y and Z, (n,) [rad]; the smallest over its candidate poses."""
    predicted = sight.group.close_loop(*triple)
    if sight.candidates is None:
        # Chords of the point that most views see, whose position is `z`; NaN in views that do not see it.
        chords, point = led_point(sight.group.measurement)
        unit = predicted.translation / np.maximum(lengths(predicted.translation), 1e-12)[:, None]
        off = lengths(unit - chords.bearings_in_camera[:, point])
        return np.where(chords.weight[:, point] > 0, off, np.nan)
    candidates = sight.candidates
    angles = rotation_angle(candidates.rotation, predicted.rotation[:, None])
    apart = lengths(candidates.translation - predicted.translation[:, None])
    distance = max(float(np.median(lengths(candidates.translation[:, 0]))), 1e-12)
    errors: Array = np.hypot(angles, apart / distance).min(1)
    return errors


def _loop(sight: PairViews, problem: Problem, pose_indices: IntArray) -> Loop:
    return sight.loop(*problem.fixed_factors(sight.group), pose_indices)


def _triples(loops: Sequence[Loop]) -> list[Triple | None]:
    """Transforms in closed form if the rotations are determined, else by a joint search over all loops.

    The closed form of three unknown rotations amplifies the noise of few views, so its result is refined.
    """
    found = {k: rotations for k, loop in enumerate(loops) if (rotations := _closed_form(loop)) is not None}
    rows_by_kind: dict[tuple[str, bool], list[int]] = {}
    for k, rotations in found.items():
        if len(loops[k].unknown) == 3 or not rotations.clear:
            rows_by_kind.setdefault((loops[k].unknown, rotations.clear), []).append(k)
    for (_, clear), rows in rows_by_kind.items():
        same = [loops[k] for k in rows]
        better = refine_rotations(same, [found[k] for k in rows]) if clear else search_rotations(same)
        found.update(zip(rows, better, strict=True))
    return [_triple(loop, found.get(k)) for k, loop in enumerate(loops)]


def _triple(loop: Loop, rotations: Rotations | None) -> Triple | None:
    if loop.x is not None and loop.y is not None and loop.z is not None:
        return loop.x, loop.y, loop.z
    try:
        return None if rotations is None else solve_translations(loop, rotations)
    except np.linalg.LinAlgError:
        return None


def _closed_form(loop: Loop) -> Rotations | None:
    """Rotations in closed form, possibly ambiguous; None if no transform is unknown or the solve fails."""
    if not loop.unknown:
        return None
    try:
        return solve_rotations(loop)
    except np.linalg.LinAlgError:
        return None


def _led_refinement(sight: PairViews, problem: Problem) -> Refinement | None:
    """Refinement to run for the point that most views see, from the best rotations of a grid; None if it fails."""
    try:
        loop = _loop(sight, problem, np.zeros(len(sight.group), dtype=np.int64))
        as_led, led_loop, starts = led_search(sight, loop, _LED_STARTS[(loop.x is None) + (loop.y is None)])
    except np.linalg.LinAlgError:
        return None
    return Refinement(as_led, led_loop, starts, is_point=True)
