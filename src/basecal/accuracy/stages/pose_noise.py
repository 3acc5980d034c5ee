"""The stage that asks whether poses of targets err as those of flat targets do, by their distance, size and tilt."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from basecal.accuracy.model_comparison.likelihoods import compare_likelihoods
from basecal.accuracy.stages.case import Case
from basecal.accuracy.stages.solving import solve_all
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.estimation.view.pose_errors import corner_covariances, whitening_matrix
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import Array

_SIZES = (0.02, 0.04, 0.08, 0.15, 0.3)  # half of a target's side, of its median distance
_TAIL_FREEDOMS = 5.0  # of Student's t: poses of targets have gross errors
_SCALE_STEPS = 30  # of the fixed point of a scale
_FEWEST_VIEWS = 6


def shape_pose_noise(case: Case) -> Case:
    """Weigh poses without stated noise by what their views hold, if their errors are clearly likelier so."""
    solution = case.solution
    groups = [_shaped_group(solution, group) for group in case.problem.groups]
    if all(new is old for new, old in zip(groups, case.problem.groups, strict=True)):
        return case
    return solve_all(replace(case, packed=case.problem.with_groups(groups)))


def _shaped_group(solution: Solution, group: ViewGroup) -> ViewGroup:
    """The group with the likeliest shape of errors; itself if equal errors are as likely."""
    views = group.measurement
    if not isinstance(views, PoseMeasurement) or np.any(views.stated) or len(group) < _FEWEST_VIEWS:
        return group
    measured = views.measured_camera_from_target
    predicted = solution.state.camera_from_target(group, solution.problem.stops)
    error = (measured.inverse() @ predicted).log()
    equal = float(_log_likelihoods(error, np.broadcast_to(np.eye(6), (len(error), 6, 6))).sum())
    shapes = list(_shapes(views))
    ratios = np.array([float(_log_likelihoods(error, shape).sum()) - equal for shape in shapes])
    if not compare_likelihoods("pose errors by tilt", ratios).is_taken:
        return group
    best = shapes[int(np.argmax(ratios))]
    return replace(group, measurement=replace(views, shape=best))


def _shapes(views: PoseMeasurement) -> Iterator[Array]:
    """Whitenings by targets of several sizes, of targets before the camera."""
    measured = views.measured_camera_from_target
    if np.all(measured.translation[:, 2] > 0):
        distance = float(np.median(np.linalg.norm(measured.translation, axis=-1)))
        for size in _SIZES:
            yield whitening_matrix(corner_covariances(measured, size * distance))


def _log_likelihoods(error: Array, shape: Array) -> Array:
    """Of each view's translation and rotation (n,), by Student's t with the scales that are likeliest."""
    whitened = (shape @ error[..., None])[..., 0]
    total = np.linalg.slogdet(shape)[1]
    for half in (whitened[:, :3], whitened[:, 3:]):
        squares = np.sum(half**2, axis=1)
        variance = max(float(np.median(squares)) / 3, 1e-300)
        for _ in range(_SCALE_STEPS):
            weight = (_TAIL_FREEDOMS + 3) / (_TAIL_FREEDOMS + squares / variance)
            variance = float(np.mean(weight * squares)) / 3
        total = (
            total - (_TAIL_FREEDOMS + 3) / 2 * np.log1p(squares / variance / _TAIL_FREEDOMS) - 1.5 * np.log(variance)
        )
    return np.asarray(total)
