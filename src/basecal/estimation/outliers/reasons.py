"""Why a view or a point was left out, in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Cell, Outlier
from basecal.estimation.outliers.classify import Classification
from basecal.estimation.outliers.inlier_mask import InlierMask, masked
from basecal.estimation.problem.problem import Problem, State, ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.point_jacobians import point_jacobians
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.estimation.view.view_pose import FEWEST_POINTS, refined
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray

_STEPS = 20
_FEWEST_3D_POINTS = 3
_LARGEST = 1000.0


def describe_outliers(
    cell: Cell, recorded: Problem, problem: Problem, state: State, kept: InlierMask, judgement: Classification
) -> tuple[Outlier, ...]:
    """What is not kept, by sample.

    Args:
        cell: What exists.
        recorded: The problem as it was recorded, which numbers the points.
        problem: The same, each view read as the state predicts.
        state: The solution's.
        kept: What is used.
        judgement: How far each view is off.
    """
    found = []
    for k, group in enumerate(problem.groups):
        as_recorded = replace(state, stop_errors=np.zeros_like(state.stop_errors))
        expected = as_recorded.camera_from_target(group, problem.stops)
        sigmas = np.sqrt(judgement.views[k].value / judgement.view_scale.variance)
        for view in np.flatnonzero(~kept.views[k]):
            reason = _of_view(group, state, expected, int(view), float(sigmas[view]))
            found.append(Outlier(int(group.sample[view]), group.camera, group.target, (), reason))
        shape = cell.targets[group.target].target
        if shape is not None:
            found += _of_points(shape.ids, recorded.groups[k], group, problem, state, kept, k)
    return tuple(sorted(found, key=lambda o: (o.sample, o.camera, o.target)))


def _of_view(group: ViewGroup, state: State, expected: SE3, view: int, sigmas: float) -> str:
    one = group.take(np.array([view]))
    pose = _alone(one, state, expected[np.array([view])])
    beyond = _sigmas(sigmas)
    if pose is not None:
        off = pose.inverse() @ expected[view]
        length, angle = float(np.linalg.norm(off.translation)), float(np.degrees(np.linalg.norm(off.rotvec)))
        return (
            f"the robots' poses and what was seen disagree{beyond}, {1e3 * length:.1f} mm and {angle:.2f} deg: "
            "a robot bumped or not settled, or poses and view of different instants"
        )
    distance = _pixels_off(one, state, expected[np.array([view])])
    where = f"{distance:.0f} px" if np.isfinite(distance) else "far"
    return f"seen {where} from where the rest predicts it{beyond}: a reflection, or a robot bumped or not settled"


def _sigmas(sigmas: float) -> str:
    if not np.isfinite(sigmas):
        return ""
    return f" by more than {_LARGEST:.0f} sigma" if sigmas > _LARGEST else f" by {sigmas:.0f} sigma"


def _alone(one: ViewGroup, state: State, near: SE3) -> SE3 | None:
    """The target's pose by a single view alone; None where it has too few points."""
    measurement = one.measurement
    if isinstance(measurement, PoseMeasurement):
        return measurement.measured_camera_from_target[0]
    fewest = FEWEST_POINTS if isinstance(measurement, PixelMeasurement) else _FEWEST_3D_POINTS
    assert isinstance(measurement, PixelMeasurement | PointMeasurement)
    if measurement.seen.sum() < fewest:
        return None
    return refined(measurement, near, state.cameras.get(one.camera), _STEPS).camera_from_target[0]


def _pixels_off(one: ViewGroup, state: State, expected: SE3) -> float:
    if not isinstance(one.measurement, PixelMeasurement):
        return np.nan
    off = np.linalg.norm(one.measurement.residual_px(expected, state.cameras[one.camera]), axis=-1)
    return float(np.nanmax(off)) if np.isfinite(off).any() else np.nan


def _of_points(
    ids: IntArray, recorded: ViewGroup, group: ViewGroup, problem: Problem, state: State, kept: InlierMask, k: int
) -> list[Outlier]:
    measurement = group.measurement
    if not isinstance(measurement, PixelMeasurement | PointMeasurement):
        return []
    lost = measurement.seen & ~kept.points[k] & kept.views[k][:, None]
    views = np.flatnonzero(lost.any(-1))
    if not len(views):
        return []
    predicted = state.camera_from_target(group, problem.stops)[views]
    off = _distances(measurement.take(views), kept.points[k][views], predicted, state.cameras.get(group.camera))
    unit = "px" if isinstance(measurement, PixelMeasurement) else "mm"
    found = []
    for v, distance in zip(views, off, strict=True):
        numbers = ids[::-1] if _is_turned(recorded, group, int(v)) else ids
        sigmas = distance[lost[v]] * measurement.weight[v][lost[v]]
        reason = _point_reason(distance[lost[v]] * (1e3 if unit == "mm" else 1.0), sigmas, unit)
        which = tuple(sorted(int(i) for i in numbers[lost[v]]))
        found.append(Outlier(int(group.sample[v]), group.camera, group.target, which, reason))
    return found


def _is_turned(recorded: ViewGroup, group: ViewGroup, view: int) -> bool:
    """Whether a view is read from the other end of its grid than it was recorded."""
    first, now = recorded.measurement, group.measurement
    if group.half_turn is None or not isinstance(first, PixelMeasurement) or not isinstance(now, PixelMeasurement):
        return False
    return not np.array_equal(first.pixels[view], now.pixels[view])


def _distances(
    measurement: PixelMeasurement | PointMeasurement, points: BoolArray, predicted: SE3, lens: Camera | None
) -> Array:
    """How far each point is from where the kept points of its view, or all else, put it, (n, p) [px or m]."""
    left = masked(measurement, points)
    pose = refined(left, predicted, lens, _STEPS).camera_from_target if (left.equations() >= 6).all() else predicted
    rows = point_jacobians(measurement, pose, lens, False)
    assert rows is not None
    weight = np.where(measurement.weight > 0, measurement.weight, 1.0)
    return np.where(rows.seen, np.linalg.norm(rows.residual, axis=-1) / weight, np.inf)


def _point_reason(off: Array, sigmas: Array, unit: str) -> str:
    worst = int(np.argmax(sigmas))
    where = f"{off[worst]:.3g} {unit}" if np.isfinite(off[worst]) else "far"
    which = "point is" if len(off) == 1 else f"{len(off)} points are up to"
    beyond = _sigmas(float(sigmas[worst])).replace(" by", "")
    return f"{which} {where} ({beyond.strip()}) from where the rest predicts it: a reflection, a wrong id or occluded"
