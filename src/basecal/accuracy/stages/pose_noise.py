"""Stage that tests whether errors of target poses depend on distance, size and tilt, as for flat targets.

`benchmarks.target_poses` judges its limits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from basecal.accuracy.model_comparison.nested_models import compare_likelihoods
from basecal.accuracy.stages.case import Case
from basecal.accuracy.stages.solving import is_explained, leave_outliers_out
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution, solve_from
from basecal.estimation.view.pose_errors import CornerErrors
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array

_MIDDLE = 0.08  # half of a target's side, over its median distance
# By size, the next one towards the middle, whose sigmas a search starts from.
_NEIGHBOURS = {_MIDDLE: _MIDDLE, 0.04: _MIDDLE, 0.02: 0.04, 0.15: _MIDDLE, 0.3: 0.15}
_SIZES = tuple(sorted(_NEIGHBOURS))
_FEWEST_VIEWS = 6


def shape_pose_noise(case: Case) -> Case:
    """Weight poses of unstated noise by the noise of their corners, if the data are clearly more likely then."""
    if not is_explained(case):
        return case
    targets = _open_targets(case.problem)
    solved_case, solutions = _with_most_views(case, targets)
    sizes = {target: size for target in targets if (size := likely_size(solved_case, target, solutions)) is not None}
    return _solve_by_corners(case, sizes) if sizes else case


def _solve_by_corners(case: Case, sizes: Mapping[str, float]) -> Case:
    last = case.solution
    packed = _shape_errors(case.problem, last.state, sizes)
    plain = solve_from(packed, without_errors(packed, last.state), case.stated_settings)
    noisy = with_noise(plain, case.settings)
    return leave_outliers_out(replace(case, packed=packed, plain=plain, noisy=noisy, robust=None))


def _with_most_views(case: Case, targets: Sequence[str]) -> tuple[Case, Mapping[float | None, Solution]]:
    """The case, or the case with corner errors if that excludes fewer views; and solutions by size of the target."""
    assert case.robust is not None
    plain: dict[float | None, Solution] = {None: case.solution}
    if not case.robust.outliers or not targets:
        return case, plain
    shaped = _solve_by_corners(case, dict.fromkeys(targets, _MIDDLE))
    assert shaped.robust is not None
    is_better = len(shaped.robust.outliers) < len(case.robust.outliers) and is_explained(shaped)
    return (shaped if is_better else case), {**plain, _MIDDLE: shaped.solution}


def _open_targets(problem: Problem) -> list[str]:
    """Targets in front of the camera whose poses were measured without stated noise."""
    return sorted({group.target for group in problem.groups if _is_open(group)})


def _is_open(group: ViewGroup) -> bool:
    views = group.measurement
    if not isinstance(views, PoseMeasurement) or np.any(views.stated) or len(group) < _FEWEST_VIEWS:
        return False
    return bool(np.all(views.measured_camera_from_target.translation[:, 2] > 0))


def likely_size(case: Case, target: str, solutions: Mapping[float | None, Solution]) -> float | None:
    """Half of a target's side over its median distance, from the evidence; None if equal errors are as likely.

    Args:
        case: The case, solved.
        target: Name of the target.
        solutions: Solutions of nearly the same views by size, None for equal errors; searches start from their sigmas.
    """
    packed, solved = replace(case.solution.problem, held=False), dict(solutions)
    for size in (None, *_NEIGHBOURS):
        # The sigmas of equal errors do not serve corner errors: these may be far from them.
        guess = solved.get(size, None if size is None else solved.get(_NEIGHBOURS[size]))
        last = guess or case.solution
        shaped = replace(last, problem=_shape_errors(packed, case.solution.state, {target: size}))
        solved[size] = with_noise(shaped, case.settings, guess)
    evidence = np.array([solved[size].noise.minus_2_log_evidence for size in (None, *_SIZES)])
    ratios = (evidence[0] - evidence[1:]) / 2
    return _peak(ratios) if compare_likelihoods(ratios).is_taken else None


def _peak(ratios: Array) -> float:
    """Size at the peak of a parabola through the largest ratio and its neighbours."""
    middle = int(np.clip(np.argmax(ratios), 1, len(_SIZES) - 2))
    logs = np.log(_SIZES)
    curvature, slope, _ = np.polyfit(logs[middle - 1 : middle + 2], ratios[middle - 1 : middle + 2], 2)
    peak = -slope / (2 * curvature) if curvature < 0 else logs[int(np.argmax(ratios))]
    return float(np.exp(np.clip(peak, logs[middle - 1], logs[middle + 1])))


def _shape_errors(problem: Problem, state: State, sizes: Mapping[str, float | None]) -> Problem:
    """Problem with pose errors of targets as from four corners of the given size, or equal errors if it is None."""
    recorded = without_errors(problem, state)
    groups = []
    for group in problem.groups:
        views = group.measurement
        if group.target in sizes and _is_open(group) and isinstance(views, PoseMeasurement):
            pose = recorded.camera_from_target(group, problem.stops)
            size = sizes[group.target]
            corners = None if size is None else _corner_errors(views.measured_camera_from_target, pose, size)
            group = replace(group, measurement=replace(views, corners=corners))
        groups.append(group)
    return problem.with_groups(groups)


def _corner_errors(measured_pose: SE3, predicted_pose: SE3, size: float) -> CornerErrors:
    """Corner errors at the predicted poses, which are free of noise; at the measured poses if these are far away."""
    distance = np.linalg.norm(measured_pose.translation, axis=-1)
    is_near = np.linalg.norm(predicted_pose.translation - measured_pose.translation, axis=-1) < distance / 2
    rotation = np.where(is_near[:, None, None], predicted_pose.rotation, measured_pose.rotation)
    pose = SE3(rotation, np.where(is_near[:, None], predicted_pose.translation, measured_pose.translation))
    return CornerErrors.from_poses(pose, size * float(np.median(distance)))
