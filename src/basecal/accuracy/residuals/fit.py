"""How well a solution fits: pixels, and the loops that views close."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from basecal.accuracy.residuals.loops import loops
from basecal.cell import Residuals, SampleResidual
from basecal.estimation.problem.problem import Problem, State
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
    """How everything fits; views that were left out stand among the samples and are in no mean.

    Views of a static scene that takes part have no residual: its points are eliminated.

    The loop of a view is `(A X B).inverse() @ Y C Z` with A and C as recorded and B from the view alone. Pixels are per
    coordinate, robots' errors taken at their most probable.
    """
    per_sample, pixels = [], [np.zeros(0)]
    for group in solution.problem.groups:
        of_views, coordinates = _group_residuals(solution, group)
        per_sample += of_views
        pixels.append(coordinates)
    all_px = np.concatenate(pixels)
    closed = np.array([(r.loop_m, r.loop_rad) for r in per_sample if r.loop_m is not None and r.loop_rad is not None])
    loop_m, loop_rad = np.sqrt(np.mean(closed**2, axis=0)) if len(closed) else (None, None)
    around = loops(solution, per_sample)
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
        loops=around,
    )


def _group_residuals(solution: Solution, group: ViewGroup) -> tuple[list[SampleResidual], Array]:
    """The residuals of each view, and of all coordinates in pixels [px]."""
    predicted = solution.state.camera_from_target(group, solution.problem.stops)
    rms, coordinates = np.full(len(group), np.nan), np.zeros(0)
    if isinstance(group.measurement, PixelMeasurement):
        off_px = group.measurement.residual_px(predicted, solution.state.cameras[group.camera])
        count = 2 * group.measurement.seen.sum(1)
        rms = np.sqrt(np.nansum(off_px**2, axis=(1, 2)) / np.maximum(count, 1))
        coordinates = off_px[np.isfinite(off_px)]
    alone, enough = single_view_pose(solution.state, group, predicted)
    as_recorded = replace(solution.state, stop_errors=np.zeros_like(solution.state.stop_errors))
    off = alone.inverse() @ as_recorded.camera_from_target(group, solution.problem.stops)
    length = np.where(enough, lengths(off.translation), np.nan)
    angle = np.where(enough, lengths(off.rotvec), np.nan)
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
    """`camera_from_target` from each view alone, (n,), near the given poses; and which views have one, (n,)."""
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
        enough = measurement.seen.sum(1) >= FEWEST_3D_POINTS
        weight = np.where(enough[:, None], measurement.weight, 1.0) ** 2
        return umeyama(points, measurement.points_in_camera, weight), enough
    camera = state.cameras[group.camera]
    alone = refine_poses(measurement, camera_from_target, camera).camera_from_target
    return alone, measurement.seen.sum(1) >= FEWEST_POINTS
