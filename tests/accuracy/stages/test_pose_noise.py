"""Tests of the weighting of target poses by the geometry of their views."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.stages import pose_noise
from basecal.accuracy.stages.case import Case
from basecal.accuracy.stages.pose_noise import (
    _MIDDLE,
    _corner_errors,
    _is_open,
    _peak,
    _solve_by_corners,
    _with_most_views,
    likely_size,
    shape_pose_noise,
)
from basecal.accuracy.stages.solving import leave_outliers_out, solve_all
from basecal.cell import PoseObservation
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import DEFAULT
from basecal.estimation.view.pose_errors import corner_covariances
from basecal.geometry import SE3, Array
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=20, target="pose", layout="eye_in_hand"), 3)


def case_of(errors: Array, sigma: Array | None = None) -> Case:
    """A noise-free recording except for these errors (n, 6) [m, rad] of its target poses."""
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
    """Errors of an arm's flange, transferred to the target."""
    mount = MADE.truth["arm_flange_from_wrist"]
    flange_from_target = mount @ SE3.stack(seen_poses())
    errors = np.random.default_rng(seed + 100).normal(size=(len(flange_from_target), 6)) * np.repeat([1e-4, 2e-4], 3)
    return (flange_from_target.inverse() @ SE3.exp(errors) @ flange_from_target).log()


def tilted_errors(seed: int) -> Array:
    covariance = corner_covariances(SE3.stack(seen_poses()), 0.03) * (0.2 / 900) ** 2
    drawn = np.random.default_rng(seed).normal(size=(len(covariance), 6))
    return (np.linalg.cholesky(covariance) @ drawn[..., None])[..., 0]


@pytest.mark.journey
def test_errors_by_tilt_are_found() -> None:
    """Poses of tags are weighted by their tilt, and the mount is nearer to the truth on average."""
    before = [case_of(tilted_errors(seed)) for seed in range(4)]
    after = [shape_pose_noise(case) for case in before]
    assert all(case.problem.groups[0].measurement.corners is not None for case in after)
    assert np.mean([error_of(case) for case in after]) < 0.8 * np.mean([error_of(case) for case in before])


@pytest.mark.journey
def test_frontal_views_are_no_outliers() -> None:
    """Equal weights exclude frontal views, so that the tilts of the rest are not informative.

    All views together are.
    """
    before = case_of(tilted_errors(15))
    after = shape_pose_noise(before)
    assert before.robust.outliers != ()
    assert after.robust.outliers == ()
    assert error_of(after) < error_of(before)


@pytest.mark.journey
def test_equal_errors_stay_equal() -> None:
    """Errors of one size for all views, and stated ones, keep their weights."""
    equal = np.random.default_rng(1).normal(size=(20, 6)) * np.repeat([5e-4, 1e-3], 3)
    case = case_of(equal)
    assert shape_pose_noise(case) is case
    stated = case_of(tilted_errors(0), np.repeat([1e-3, 1e-3], 3))
    assert shape_pose_noise(stated) is stated


@pytest.mark.journey
def test_sizes_of_targets_are_found() -> None:
    """The evidence of the target size peaks near the truth, with robot errors as large as view errors."""
    distance = np.median([np.linalg.norm(each.translation) for each in seen_poses()])
    sizes = [likely_size(case_of(tilted_errors(seed) + arm_errors(seed)), "board", {}) for seed in range(3)]
    assert all(size is not None and 0.5 < size * distance / 0.03 < 2 for size in sizes)


@pytest.mark.journey
def test_known_solutions_only_speed_up_search() -> None:
    """Known solutions with equal errors or another size lead to the same size."""
    case = case_of(tilted_errors(0) + arm_errors(0))
    alone = likely_size(case, "board", {})
    shaped = _solve_by_corners(case, {"board": _MIDDLE}).solution
    assert likely_size(case, "board", {None: case.solution, _MIDDLE: shaped}) == pytest.approx(alone, rel=1e-2)


SIZES = np.array([0.02, 0.04, 0.08, 0.15, 0.3])


@pytest.mark.parametrize("peak", [0.03, 0.05, 0.1, 0.2])
def test_size_is_peak_of_parabola(peak: float) -> None:
    """The size is the peak of a parabola of the log size, for any height and width."""
    for height, width in ((0.0, 1.0), (50.0, 3.0)):
        assert _peak(height - width * np.log(SIZES / peak) ** 2) == pytest.approx(peak)


def test_size_is_within_neighbours() -> None:
    """Beyond the ends the size is that of the end; without a peak in between it is the likelier end."""
    assert _peak(-(np.log(SIZES / 1e-3) ** 2)) == pytest.approx(0.02)
    assert _peak(-(np.log(SIZES / 9.0) ** 2)) == pytest.approx(0.3)
    assert _peak(np.array([5.0, 1.0, 0.0, 0.5, 1.0])) == pytest.approx(0.02)
    assert _peak(np.array([1.0, 0.5, 0.0, 1.0, 5.0])) == pytest.approx(0.3)


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_size_is_taken_by_evidence(monkeypatch: pytest.MonkeyPatch, factor: float) -> None:
    """A size is taken if its mean likelihood over all sizes is fifty times larger.

    It counts half of the decrease of minus twice the log evidence.
    """
    ratios = 4.3 * factor - np.log(SIZES / 0.08) ** 2 - 1.5
    evidence = dict(zip((None, *SIZES), [100.0, *(100.0 - 2 * ratios)], strict=True))
    found = SimpleNamespace(problem=None, state=None)
    monkeypatch.setattr(pose_noise, "replace", lambda of, **changed: SimpleNamespace(problem=changed.get("problem")))
    monkeypatch.setattr(pose_noise, "_shape_errors", lambda problem, state, sizes: sizes["board"])

    def solved(solution, settings, guess):
        """A solution with the evidence of its size."""
        return SimpleNamespace(noise=SimpleNamespace(minus_2_log_evidence=evidence[solution.problem]))

    monkeypatch.setattr(pose_noise, "with_noise", solved)
    size = likely_size(SimpleNamespace(solution=found, settings=None), "board", {})
    assert size == (None if factor == 1.0 else pytest.approx(0.08))


@pytest.mark.parametrize(("before", "after", "explained", "taken"), [
    (0, 0, True, False), (3, 2, True, True), (3, 3, True, False), (3, 2, False, False),
])  # fmt: skip
def test_fewer_outliers_with_corners_are_used(
    monkeypatch: pytest.MonkeyPatch, before: int, after: int, explained: bool, taken: bool
) -> None:
    """The solution by corners of a middle size is used if it has fewer outliers and explains the motion, too."""
    given = []
    case, shaped = (
        SimpleNamespace(robust=SimpleNamespace(outliers=(1,) * count), solution=f"{count} left out")
        for count in (before, after)
    )
    monkeypatch.setattr(pose_noise, "_solve_by_corners", lambda case, sizes: given.append(sizes) or shaped)
    monkeypatch.setattr(pose_noise, "is_explained", lambda case: explained)
    judged, solutions = _with_most_views(case, ["a", "b"])
    assert judged is (shaped if taken else case)
    assert solutions == {None: case.solution} | ({0.08: shaped.solution} if before else {})
    assert given == ([{"a": 0.08, "b": 0.08}] if before else [])


def test_open_poses_need_six_unstated_views() -> None:
    """Pose noise is open for at least six unstated poses, all in front of the camera."""
    (group,) = case_of(np.zeros((20, 6))).problem.groups
    assert _is_open(group)
    assert _is_open(group.take(np.arange(6)))
    assert not _is_open(group.take(np.arange(5)))
    views = group.measurement
    poses = views.measured_camera_from_target
    behind = SE3(poses.rotation, poses.translation * np.where(np.arange(20) == 3, -1.0, 1.0)[:, None])
    assert not _is_open(replace(group, measurement=replace(views, measured_camera_from_target=behind)))
    stated = np.zeros_like(views.stated)
    stated[2, 1] = 1.0
    assert not _is_open(replace(group, measurement=replace(views, stated=stated)))
    assert not _is_open(replace(group, measurement=None))


def test_corners_use_predicted_near_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Corners use predicted poses, or measured ones if the prediction is off by half the distance.

    Their size scales with the median distance.
    """
    monkeypatch.setattr(pose_noise.CornerErrors, "from_poses", lambda poses, half_m: (poses, half_m))
    measured = SE3(np.tile(np.eye(3), (3, 1, 1)), np.array([[0, 0, 1.0], [0, 0, 2.0], [0, 0, 4.0]]))
    turned = SE3.from_rotvec([0.1, 0, 0], [0, 0, 0]).rotation
    predicted = SE3(np.tile(turned, (3, 1, 1)), np.array([[0, 0, 1.49], [0, 0, 3.01], [0, 0, 5.9]]))
    poses, half_m = _corner_errors(measured, predicted, 0.1)
    np.testing.assert_array_equal(poses.translation[:, 2], [1.49, 2.0, 5.9])
    np.testing.assert_array_equal(poses.rotation, [turned, np.eye(3), turned])
    assert half_m == pytest.approx(0.2)
