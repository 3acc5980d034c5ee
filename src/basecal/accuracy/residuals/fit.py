"""Residuals of a solution: pixel residuals, and closure errors of loops."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Loop, Residuals, SampleResidual, Unknown
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.noise.robot_noise import some_views, without_errors
from basecal.estimation.observability.observability import analyse_observability
from basecal.estimation.problem.problem import Problem, State, sequential_columns
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.estimation.start.pair_views import umeyama
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.estimation.view.view_pose import FEWEST_3D_POINTS, FEWEST_POINTS, refine_poses
from basecal.geometry import SE3, Array, BoolArray
from basecal.geometry.rotation import lengths
from basecal.numerics.spectral import dimension


def residuals(solution: Solution, outliers: Problem | None = None) -> Residuals:
    """Compute the residuals of a solution; outlier views are listed by sample but excluded from all means.

    Views of a static scene have no residuals, as the scene's points are eliminated.

    The loop of a view is `(A X B).inverse() @ Y C Z` with A and C as recorded and B from the view alone. Pixel
    residuals are per coordinate, with the most probable errors of the robots.

    Args:
        solution: The solution.
        outliers: The problem of the views that were left out; None without any.
    """
    per_sample, pixels = [], [np.zeros(0)]
    for group in solution.problem.groups:
        of_views, coordinates = _group_residuals(solution, group)
        per_sample += of_views
        pixels.append(coordinates)
    all_px = np.concatenate(pixels)
    closed = np.array([(r.loop_m, r.loop_rad) for r in per_sample if r.loop_m is not None and r.loop_rad is not None])
    loop_m, loop_rad = np.sqrt(np.mean(closed**2, axis=0)) if len(closed) else (None, None)
    pair_loops = loops(solution, per_sample)
    for group in outliers.groups if outliers is not None else ():
        per_sample += _group_residuals(solution, group)[0]
    tied = solution.problem.tied
    for group in () if tied is None else tied.groups:
        per_sample += [SampleResidual(number, group.camera, group.target) for number in group.sample.tolist()]
    return Residuals(
        rms_px=float(np.sqrt(np.mean(all_px**2))) if len(all_px) else None,
        median_px=float(np.median(np.abs(all_px))) if len(all_px) else None,
        loop_rms_m=None if loop_m is None else float(loop_m),
        loop_rms_rad=None if loop_rad is None else float(loop_rad),
        per_sample=tuple(sorted(per_sample, key=lambda r: (r.sample, r.camera, r.target))),
        loops=pair_loops,
    )


def _group_residuals(solution: Solution, group: ViewGroup) -> tuple[list[SampleResidual], Array]:
    """Residuals of each view, and pixel residuals of all coordinates, (n,) [px]."""
    predicted = solution.state.camera_from_target(group, solution.problem.stops)
    rms, coordinates = np.full(len(group), np.nan), np.zeros(0)
    if isinstance(group.measurement, PixelMeasurement):
        off_px = group.measurement.residual_px(predicted, solution.state.cameras[group.camera])
        count = 2 * group.measurement.seen.sum(1)
        rms = np.sqrt(np.nansum(off_px**2, axis=(1, 2)) / np.maximum(count, 1))
        coordinates = off_px[np.isfinite(off_px)]
    alone, is_valid = single_view_pose(solution.state, group, predicted)
    as_recorded = without_errors(solution.problem, solution.state)
    off = alone.inverse() @ as_recorded.camera_from_target(group, solution.problem.stops)
    length = np.where(is_valid, lengths(off.translation), np.nan)
    angle = np.where(is_valid, lengths(off.rotvec), np.nan)
    of_views = [
        SampleResidual(int(number), group.camera, group.target, *fit)
        for number, *fit in zip(
            group.sample, _finite_values(rms), _finite_values(length), _finite_values(angle), strict=True
        )
    ]
    return of_views, coordinates


def _finite_values(values: Array) -> Iterator[float | None]:
    return (float(v) if np.isfinite(v) else None for v in values)


def single_view_pose(state: State, group: ViewGroup, camera_from_target: SE3) -> tuple[SE3, BoolArray]:
    """`camera_from_target` from each view alone, (n,), starting at given poses, and the mask of valid poses, (n,)."""
    measurement = group.measurement
    everywhere = np.ones(len(group), dtype=bool)
    if isinstance(measurement, PoseMeasurement):
        return measurement.measured_camera_from_target, everywhere
    if not isinstance(measurement, PixelMeasurement | PointMeasurement):
        return camera_from_target, ~everywhere
    points = measurement.points_in_target
    if dimension(points) < 2:
        return camera_from_target, ~everywhere
    if isinstance(measurement, PointMeasurement):
        is_valid = measurement.seen.sum(1) >= FEWEST_3D_POINTS
        weight = np.where(is_valid[:, None], measurement.weight, 1.0) ** 2
        return umeyama(points, measurement.points_in_camera, weight), is_valid
    camera = state.cameras[group.camera]
    alone = refine_poses(measurement, camera_from_target, camera).camera_from_target
    return alone, measurement.seen.sum(1) >= FEWEST_POINTS


_PAIR_FIT_STEPS = 50  # of the fit of a single pair, which starts at the solution; assumed: bounds the time


@dataclass(frozen=True, eq=False)
class _Relation:
    """Relative pose of two bases from the views of one camera and target, with lenses and robots of the solution."""

    start: str
    end: str
    path: tuple[str, ...]
    start_from_end: SE3
    views: int

    def reverse(self) -> _Relation:
        """Return the relation with start and end exchanged."""
        return _Relation(self.end, self.start, self.path[::-1], self.start_from_end.inverse(), self.views)


def loops(solution: Solution, residuals: Sequence[SampleResidual]) -> tuple[Loop, ...]:
    """Closure errors of the loops of each pair of camera and target, rms over views, and of rings of bases.

    Several pairs may relate the same bases, directly or around a ring. Each pair then gives the relative pose of its
    two bases from its own views alone. The pair's mounts are estimated again if its views determine them. The product
    of these poses around the ring should be the identity.

    Args:
        solution: The solution.
        residuals: Residuals of the solution's views.
    """
    bases = {(g.camera, g.target): _bases(solution.problem, g) for g in solution.problem.groups}
    of_pairs: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    for r in residuals:
        if r.loop_m is not None and r.loop_rad is not None:
            of_pairs[r.camera, r.target].append((r.loop_m, r.loop_rad))
    found = []
    for pair, (eye_base, hand_base) in bases.items():
        closed = np.array(of_pairs[pair])
        if len(closed):
            rms_m, rms_rad = np.sqrt(np.mean(closed**2, axis=0))
            found.append(Loop((eye_base, *pair, hand_base), len(closed), float(rms_m), float(rms_rad)))
    return (*found, *_ring_loops(solution))


def _bases(problem: Problem, group: ViewGroup) -> tuple[str, str]:
    """Names of the bases of the camera's robot and of the target's robot; the reference's base for `world`."""
    eye, hand = (end.robot or problem.reference for end in group.ends)
    return f"{eye}_base", f"{hand}_base"


def _ring_loops(solution: Solution) -> list[Loop]:
    """One loop for each pair of camera and target that is not part of a spanning tree over the bases."""
    if len(solution.problem.groups) < 2:
        return []
    paths: dict[str, list[_Relation]] = {f"{solution.problem.reference}_base": []}
    waiting, found = _relations(solution), []
    while waiting:
        relation = next((r for r in waiting if r.start in paths or r.end in paths), None)
        if relation is None:
            break
        waiting.remove(relation)
        forward = relation if relation.start in paths else relation.reverse()
        if forward.end in paths:
            back = [step.reverse() for step in reversed(paths[forward.end])]
            found.append(_close_loop([*paths[forward.start], forward, *back]))
        else:
            paths[forward.end] = [*paths[forward.start], forward]
    return found


def _close_loop(steps: Sequence[_Relation]) -> Loop:
    """Chain relations to a loop; a relation at the start that is reversed at the end is left out."""
    while len(steps) > 2 and steps[0].path == steps[-1].path[::-1]:
        steps = steps[1:-1]
    closure = SE3.identity()
    for step in steps:
        closure = closure @ step.start_from_end
    path = (*steps[0].path, *(name for step in steps[1:] for name in step.path[1:]))
    off = closure.log()
    return Loop(
        path,
        sum(step.views for step in steps),
        float(np.linalg.norm(closure.translation)),
        float(np.linalg.norm(off[3:])),
    )


def _relations(solution: Solution) -> list[_Relation]:
    """Relations of all pairs between two different bases that the pair's own views determine."""
    relations = []
    for group in solution.problem.groups:
        start, end = _bases(solution.problem, group)
        base = group.hand.base or group.eye.base
        if start == end or base is None or not len(group):
            continue
        mounts = [end.mount for end in group.ends if end.mount in solution.problem.columns]
        state = _fit_pair(solution, group, base, mounts) or _fit_pair(solution, group, base, [])
        if state is not None:
            path = (start, group.camera, group.target, end)
            relations.append(_Relation(start, end, path, group.eye_base_from_hand_base(state.transforms), len(group)))
    return relations


def _fit_pair(solution: Solution, group: ViewGroup, base: str, mounts: Sequence[str]) -> State | None:
    """Fit a base and mounts to the views of one pair, without the base's prior; None if the base is unobservable."""
    whole, state = some_views(solution.problem.with_groups([group]), solution.state, len(group))
    columns = sequential_columns({name: whole.column_width(name) for name in mounts} | {base: 6})
    problem = replace(whole, columns=columns, unknowns={**whole.unknowns, base: Unknown()}, models={})
    end = bundle_adjust(problem, state, degrees_of_freedom(problem), _PAIR_FIT_STEPS)
    observability = analyse_observability(problem, end.state, end.normal.hessian, solution.noise.factor)
    return end.state if end.converged and base not in observability.unobservable else None
