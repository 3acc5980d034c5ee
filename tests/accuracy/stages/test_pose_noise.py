"""Whether poses of targets are weighed by what their views hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.stages.case import Case
from basecal.accuracy.stages.pose_noise import _MIDDLE, _solve_by_corners, likely_size, shape_pose_noise
from basecal.accuracy.stages.solving import leave_outliers_out, solve_all
from basecal.cell import PoseObservation
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import DEFAULT
from basecal.estimation.view.pose_errors import corner_covariances
from basecal.geometry import SE3, Array
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=20, target="pose", layout="eye_in_hand"), 3)


def case_of(errors: Array, sigma: Array | None = None) -> Case:
    """A recording without noise but these errors (n, 6) [m, rad] of its poses of the target."""
    mount, target = MADE.truth["arm_flange_from_wrist"], MADE.truth["arm_base_from_board"]
    seen = (MADE.true_base_from_flange["arm"] @ mount).inverse() @ target @ SE3.exp(errors)
    samples = tuple(
        replace(sample, observations=(PoseObservation("wrist", "board", seen[k], sigma),))
        for k, sample in enumerate(MADE.recording.samples)
    )
    recording = replace(MADE.recording, samples=samples)
    problem, _ = build_problem(MADE.cell, recording)
    return leave_outliers_out(solve_all(Case(MADE.cell, recording, DEFAULT, packed=problem)))


def error_of(case: Case) -> float:
    off = case.solution.state.transforms["arm_flange_from_wrist"].inverse() @ MADE.truth["arm_flange_from_wrist"]
    return float(np.linalg.norm(off.log()))


def seen_poses() -> list[SE3]:
    return [sample.observations[0].camera_from_target for sample in MADE.recording.samples]


def arm_errors(seed: int) -> Array:
    """As an arm's flange has them, carried to the target."""
    mount = MADE.truth["arm_flange_from_wrist"]
    flange_from_target = mount @ SE3.stack(seen_poses())
    errors = np.random.default_rng(seed + 100).normal(size=(len(flange_from_target), 6)) * np.repeat([1e-4, 2e-4], 3)
    return (flange_from_target.inverse() @ SE3.exp(errors) @ flange_from_target).log()


def tilted_errors(seed: int) -> Array:
    covariance = corner_covariances(SE3.stack(seen_poses()), 0.03) * (0.2 / 900) ** 2
    drawn = np.random.default_rng(seed).normal(size=(len(covariance), 6))
    return (np.linalg.cholesky(covariance) @ drawn[..., None])[..., 0]


def test_errors_by_tilt_are_found() -> None:
    """Poses of tags are weighed by their tilt, and the mount is nearer to the truth on the whole."""
    before = [case_of(tilted_errors(seed)) for seed in range(4)]
    after = [shape_pose_noise(case) for case in before]
    assert all(case.problem.groups[0].measurement.corners is not None for case in after)
    assert np.mean([error_of(case) for case in after]) < 0.8 * np.mean([error_of(case) for case in before])


def test_views_from_the_front_are_no_outliers() -> None:
    """Equal errors leave out views from the front, and their tilts then say nothing; all views together say it."""
    before = case_of(tilted_errors(15))
    after = shape_pose_noise(before)
    assert before.robust.outliers != ()
    assert after.robust.outliers == ()
    assert error_of(after) < error_of(before)


def test_equal_errors_stay_equal() -> None:
    """Errors of one size for all views, and stated ones, are weighed as they are."""
    equal = np.random.default_rng(1).normal(size=(20, 6)) * np.repeat([5e-4, 1e-3], 3)
    case = case_of(equal)
    assert shape_pose_noise(case) is case
    stated = case_of(tilted_errors(0), np.repeat([1e-3, 1e-3], 3))
    assert shape_pose_noise(stated) is stated


def test_sizes_of_targets_are_found() -> None:
    """The evidence of the target's size peaks near the truth, of arms with errors as large as those of the views."""
    distance = np.median([np.linalg.norm(each.translation) for each in seen_poses()])
    sizes = [likely_size(case_of(tilted_errors(seed) + arm_errors(seed)), "board", {}) for seed in range(3)]
    assert all(size is not None and 0.5 < size * distance / 0.03 < 2 for size in sizes)


def test_known_solutions_only_speed_up_the_search() -> None:
    """Sigmas of equal errors or of another size lead to the same size."""
    case = case_of(tilted_errors(0) + arm_errors(0))
    alone = likely_size(case, "board", {})
    shaped = _solve_by_corners(case, {"board": _MIDDLE}).solution
    assert likely_size(case, "board", {None: case.solution, _MIDDLE: shaped}) == pytest.approx(alone, rel=1e-2)
