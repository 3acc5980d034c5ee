"""The stage that asks whether poses of targets err as those of flat targets do, by their distance, size and tilt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.accuracy.model_comparison.likelihoods import compare_likelihoods
from basecal.accuracy.stages.case import Case
from basecal.accuracy.stages.solving import is_explained, leave_outliers_out, solve_all
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.pose_errors import corner_covariances, whitening_matrix
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array

_SIZES = (0.02, 0.04, 0.08, 0.15, 0.3)  # half of a target's side, of its median distance
_FEWEST_VIEWS = 6


def shape_pose_noise(case: Case) -> Case:
    """Weigh poses without stated noise by what their views hold, if their errors are clearly likelier so."""
    if not is_explained(case):
        return case
    packed = case.problem
    sizes = {target: size for target in _open_targets(packed) if (size := likely_size(case, target)) is not None}
    if not sizes:
        return case
    weighed = replace(case, packed=_shape_errors(packed, case.solution.state, sizes), robust=None)
    return leave_outliers_out(solve_all(weighed))


def _open_targets(problem: Problem) -> list[str]:
    """Targets before the camera, of which poses without stated noise were measured."""
    return sorted({group.target for group in problem.groups if _is_open(group)})


def _is_open(group: ViewGroup) -> bool:
    views = group.measurement
    if not isinstance(views, PoseMeasurement) or np.any(views.stated) or len(group) < _FEWEST_VIEWS:
        return False
    return bool(np.all(views.measured_camera_from_target.translation[:, 2] > 0))


def likely_size(case: Case, target: str) -> float | None:
    """Half of a target's side over its median distance, by the evidence; None if equal errors are as likely."""
    solution = replace(case.solution, problem=replace(case.solution.problem, held=False))
    equal = with_noise(solution, case.settings).noise.minus_2_log_evidence
    ratios = np.zeros(len(_SIZES))
    for k, size in enumerate(_SIZES):
        problem = _shape_errors(solution.problem, solution.state, {target: size})
        ratios[k] = (
            equal - with_noise(replace(solution, problem=problem), case.settings).noise.minus_2_log_evidence
        ) / 2
    return _peak(ratios) if compare_likelihoods("pose errors by tilt", ratios).is_taken else None


def _peak(ratios: Array) -> float:
    """The size at which a parabola through the largest ratio and its neighbours peaks."""
    at = int(np.clip(np.argmax(ratios), 1, len(_SIZES) - 2))
    logs = np.log(_SIZES)
    bend, slope, _ = np.polyfit(logs[at - 1 : at + 2], ratios[at - 1 : at + 2], 2)
    peak = -slope / (2 * bend) if bend < 0 else logs[int(np.argmax(ratios))]
    return float(np.exp(np.clip(peak, logs[at - 1], logs[at + 1])))


def _shape_errors(problem: Problem, state: State, sizes: Mapping[str, float]) -> Problem:
    """The problem with the errors of these targets' poses as of four corners of this size each."""
    recorded = without_errors(problem, state)
    groups = []
    for group in problem.groups:
        views = group.measurement
        if group.target in sizes and _is_open(group) and isinstance(views, PoseMeasurement):
            pose = recorded.camera_from_target(group, problem.stops)
            shape = _whitening(views.measured_camera_from_target, pose, sizes[group.target])
            group = replace(group, measurement=replace(views, shape=shape))
        groups.append(group)
    return problem.with_groups(groups)


def _whitening(measured_pose: SE3, predicted_pose: SE3, size: float) -> Array:
    """(n, 6, 6) at the predicted poses, of which noise takes no part; at measured ones where these are far from it."""
    distance = np.linalg.norm(measured_pose.translation, axis=-1)
    is_near = np.linalg.norm(predicted_pose.translation - measured_pose.translation, axis=-1) < distance / 2
    rotation = np.where(is_near[:, None, None], predicted_pose.rotation, measured_pose.rotation)
    at = SE3(rotation, np.where(is_near[:, None], predicted_pose.translation, measured_pose.translation))
    return whitening_matrix(corner_covariances(at, size * float(np.median(distance))))
