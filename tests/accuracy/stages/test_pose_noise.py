"""Whether poses of targets are weighed by what their views hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.stages.case import Case
from basecal.accuracy.stages.pose_noise import shape_pose_noise
from basecal.accuracy.stages.solving import solve_all
from basecal.cell import PoseObservation
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import STATED
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
    return solve_all(Case(MADE.cell, recording, STATED, packed=problem))


def error_of(case: Case) -> float:
    off = case.solution.state.transforms["arm_flange_from_wrist"].inverse() @ MADE.truth["arm_flange_from_wrist"]
    return float(np.linalg.norm(off.log()))


def tilted_errors(seed: int) -> Array:
    seen = [sample.observations[0].camera_from_target for sample in MADE.recording.samples]
    covariance = corner_covariances(SE3.stack(seen), 0.03) * (0.2 / 900) ** 2
    drawn = np.random.default_rng(seed).normal(size=(len(seen), 6))
    return (np.linalg.cholesky(covariance) @ drawn[..., None])[..., 0]


def test_errors_by_tilt_are_found() -> None:
    """Poses of tags are weighed by their tilt, and the mount is nearer to the truth on the whole."""
    before = [case_of(tilted_errors(seed)) for seed in range(4)]
    after = [shape_pose_noise(case) for case in before]
    assert all(case.problem.groups[0].measurement.shape is not None for case in after)
    assert np.mean([error_of(case) for case in after]) < 0.8 * np.mean([error_of(case) for case in before])


def test_equal_errors_stay_equal() -> None:
    """Errors of one size for all views, and stated ones, are weighed as they are."""
    equal = np.random.default_rng(1).normal(size=(20, 6)) * np.repeat([5e-4, 1e-3], 3)
    case = case_of(equal)
    assert shape_pose_noise(case) is case
    stated = case_of(tilted_errors(0), np.repeat([1e-3, 1e-3], 3))
    assert shape_pose_noise(stated) is stated
