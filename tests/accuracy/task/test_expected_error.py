"""Tests of expected errors, compared with random draws, and of tolerances."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi, chi2, ncx2, norm
from tests.ends import with_eye, with_hand

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import fit_details
from basecal.accuracy.task import expected_error
from basecal.accuracy.task.expected_error import (
    ExpectedError,
    _places,
    check_tolerance,
    expected_errors,
    length_quantile,
    length_quantiles,
    point_covariances,
    pooled_quantile,
)
from basecal.cell import MeetingError, Tolerance
from basecal.estimation.problem.build import build_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


def rotated_covariance(variances):
    """A covariance with these variances along rotated axes."""
    rotation = SE3.exp(np.array([0, 0, 0, 0.4, -0.7, 0.2])).rotation
    return rotation @ np.diag(variances) @ rotation.T


@pytest.mark.parametrize(
    ("variances", "quantile"),
    [
        ([4.0, 4.0, 4.0], 2 * chi.ppf(0.95, 3)),
        ([4.0, 0.0, 0.0], 2 * norm.ppf(0.975)),
        ([9, 9, 0], 3 * chi.ppf(0.95, 2)),
    ],
)
def test_quantile_of_special_shapes(variances, quantile):
    """Quantiles of a ball, a disc and a needle equal their closed forms within 1e-6."""
    assert length_quantile(rotated_covariance(variances)) == pytest.approx(quantile, rel=1e-6)


def test_quantile_matches_draws():
    """95 % of 200,000 draws are shorter than the quantile, within three sigmas of their number (0.15 %)."""
    covariance = rotated_covariance([1.0, 0.3, 0.02])
    drawn = np.random.default_rng(1).multivariate_normal(np.zeros(3), covariance, 200_000)
    shorter = np.mean(np.linalg.norm(drawn, axis=1) < length_quantile(covariance))
    assert shorter == pytest.approx(0.95, abs=1.5e-3)


@pytest.mark.parametrize("variances", [[1.0, 0.3, 0.02], [1.0, 1.0, 1.0], [1.0, 1e-9, 0.0]])
@pytest.mark.parametrize("size", [0.1, 1.0, 10.0])
def test_quantile_about_mean_matches_draws(variances, size):
    """94 to 96 % of 200,000 draws about a known offset are shorter than the quantile."""
    covariance, mean = rotated_covariance(variances), size * np.array([0.6, -0.5, 0.6])
    drawn = np.random.default_rng(1).multivariate_normal(mean, covariance, 200_000)
    (length,) = length_quantiles(covariance[None], mean[None])
    assert 0.94 < np.mean(np.linalg.norm(drawn, axis=1) < length) < 0.96


def test_tiny_mean_has_no_effect():
    """A tiny mean changes the quantile by at most a hundredth: four cumulants approximate the exact value."""
    covariances = np.stack([rotated_covariance([1.0, 0.3, 0.02])] * 2)
    exact, about = length_quantiles(covariances), length_quantiles(covariances, np.array([[0.0, 0, 0], [1e-9, 0, 0]]))
    np.testing.assert_allclose(about, exact, rtol=1e-2)


def test_zero_covariance_has_quantile_of_mean():
    """A zero covariance has a quantile of zero, and with a mean the length of the mean."""
    assert length_quantile(np.zeros((3, 3))) == 0.0
    np.testing.assert_allclose(length_quantiles(np.zeros((1, 3, 3)), np.array([[0.3, 0.0, 0.4]])), 0.5)


@pytest.fixture(scope="module")
def dual():
    """Two arms with noise, calibrated."""
    made = simulate(Scenario(samples=15, robot_noise=(1e-4, 2e-4)), 4)
    return made, calibrate(made.cell, made.recording)


def test_expected_error_is_that_of_transformed_point(dual):
    """Draws of the transform move the stated point by the expected error, and no recorded flange by more."""
    made, calibration = dual
    (error,) = fit_details(made.cell, made.recording, calibration).errors
    estimate = calibration[BASE]
    tangents = np.random.default_rng(2).multivariate_normal(np.zeros(6), estimate.covariance, 100_000)
    moved = SE3.exp(tangents)

    def quantile(point, moved=moved):
        return float(np.quantile(np.linalg.norm(moved @ point[None] - point, axis=-1), 0.95))

    assert error.transform == BASE
    assert quantile(error.at_m) == pytest.approx(error.length_m, rel=0.01)
    flanges = [s.robots["hand"].base_from_flange.translation for s in made.recording.samples]
    assert min(np.linalg.norm(flange - error.at_m) for flange in flanges) < 1e-3
    assert max(quantile(flange, moved[:10_000]) for flange in flanges) <= 1.05 * error.length_m


def test_mount_errors_are_at_target():
    """The error of a camera mount is at the target's distance, that of a target at one of its points."""
    made = simulate(Scenario(samples=15, layout="eye_in_hand", robot_noise=(1e-4, 2e-4)), 4)
    calibration = calibrate(made.cell, made.recording)
    details = fit_details(made.cell, made.recording, calibration)
    by_name = {error.transform: error for error in details.errors}
    assert set(by_name) == set(made.cell.requested_transforms)
    mount = by_name[made.cell.mount_name("wrist")]
    (views,) = details.views
    assert any(np.allclose(mount.at_m, place) for place in views.camera_from_target.translation)
    target = next(iter(made.cell.targets.values()))
    at = by_name[made.cell.mount_name(target.name)].at_m
    assert any(np.allclose(at, point) for point in target.target.points)


def test_tolerance_needs_small_error_and_good_verdict(dual):
    """A tolerance is met if the error is below it, the verdict good, and every requested transform present."""
    made, calibration = dual[0], replace(dual[1], meeting=None)
    errors = [ExpectedError(BASE, 4e-4, np.zeros(3))]

    def check(tolerance_m, verdict="good", found=errors):
        return check_tolerance(
            made.cell, replace(calibration, verdict=verdict, settings={"tolerance_m": tolerance_m}), found
        )

    assert check(None) is None
    assert check(5e-4).met
    assert not check(3e-4).met
    assert not check(5e-4, verdict="doubtful").met
    assert not check(5e-4, found=[]).met
    assert check(5e-4, found=[]).expected_95_m is None
    assert check(3e-4).expected_95_m == 4e-4
    assert check(4e-4) == Tolerance(4e-4, 4e-4, True)
    both = SimpleNamespace(requested_transforms=(BASE, "mount"), reference="eye")
    two = [*errors, ExpectedError("mount", 6e-4, np.zeros(3))]
    found = check_tolerance(both, replace(calibration, verdict="good", settings={"tolerance_m": 5e-4}), two)
    assert (found.expected_95_m, found.met) == (6e-4, False)
    meeting = MeetingError(3e-4, "task point", 1e-4)
    at_work = replace(calibration, verdict="good", settings={"tolerance_m": 5e-4}, meeting=meeting)
    assert check_tolerance(made.cell, at_work, errors) == Tolerance(5e-4, 3e-4, True)
    assert check_tolerance(both, at_work, two).expected_95_m == 6e-4
    nothing = SimpleNamespace(requested_transforms=(), reference="eye")
    found = check_tolerance(nothing, replace(calibration, verdict="good", settings={"tolerance_m": 1e-6}), [])
    assert (found.expected_95_m, found.met) == (0.0, True)


def test_pose_target_is_used_at_origin():
    """A target seen only as poses has no shape and is used at its origin; a board is used at all of its points."""
    for target, count in (("pose", 1), ("charuco", 36)):
        made = simulate(Scenario(samples=4, target=target), 0)
        if target == "pose":
            targets = {name: replace(of, target=None) for name, of in made.cell.targets.items()}
            made = replace(made, cell=replace(made.cell, targets=targets))
        problem, _ = build_problem(made.cell, made.recording)
        (places,) = _places("hand_flange_from_board", made.cell, SimpleNamespace(problem=problem))
        assert places.shape == (count, 3)


@pytest.mark.parametrize("sigma", [0.02, 3.0])
@pytest.mark.parametrize("mean", [[0.1, 0.0, 0.0], [1.0, -2.0, 2.0]])
def test_quantile_of_ball_about_mean(sigma, mean):
    """The squared length of a ball about a mean is noncentral chi-square with three freedoms.

    Four cumulants give it exactly.
    """
    mean = sigma * np.array(mean)
    (length,) = length_quantiles(sigma**2 * np.eye(3)[None], mean[None])
    assert length == pytest.approx(sigma * np.sqrt(ncx2.ppf(0.95, 3, mean @ mean / sigma**2)), rel=1e-6)


def test_zero_mean_equals_no_mean():
    """A zero mean gives the exact quantile without mean, and each of many covariances has its own mean."""
    covariances = np.stack([rotated_covariance([1.0, 0.3, 0.02]), rotated_covariance([4.0, 1.0, 1.0])])
    exact = length_quantiles(covariances)
    np.testing.assert_array_equal(length_quantiles(covariances, np.zeros((2, 3))), exact)
    means = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    both = length_quantiles(covariances, means)
    assert both[0] == pytest.approx(exact[0], rel=1e-2)
    assert both[1] > 1.2 * exact[1]
    assert both[1] == pytest.approx(length_quantiles(covariances[1:], means[1:])[0], rel=1e-12)


def test_covariances_at_points():
    """A rotation moves a point by its distance, a translation all points equally; their correlation counts."""
    shift, turn = 1e-3, 2e-3
    covariance = np.diag([shift**2] * 3 + [0.0, 0.0, turn**2])
    covariance[0, 5] = covariance[5, 0] = 0.5 * shift * turn
    (at,) = point_covariances(covariance, np.array([[0.0, 3.0, 7.0]]))
    expected = np.diag([shift**2 + 9 * turn**2 - 2 * 3 * 0.5 * shift * turn, shift**2, shift**2])
    np.testing.assert_allclose(at, expected, atol=1e-15)


def test_error_is_at_worst_place(monkeypatch):
    """The error of each requested transform is that at its worst place.

    Without a place or finite covariance there is none.
    """
    covariance = np.diag([1e-6] * 3 + [4e-6] * 3)
    places = {"a": [np.array([[0.1, 0, 0], [0, 0.5, 0]]), np.array([[0, 0, 0.2]])], "b": [], "d": [np.zeros((1, 3))]}
    monkeypatch.setattr(expected_error, "_places", lambda name, cell, fitted: iter(places[name]))
    estimates = {name: SimpleNamespace(covariance=covariance) for name in "abd"}
    estimates["d"] = SimpleNamespace(covariance=np.full((6, 6), np.inf))
    calibration = type("Found", (dict,), {"transforms": estimates})(estimates)
    (found,) = expected_errors(SimpleNamespace(requested_transforms=("a", "b", "c", "d")), calibration, None)
    assert found.transform == "a"
    np.testing.assert_array_equal(found.at_m, [0.0, 0.5, 0.0])
    variances = 1e-6 + 4e-6 * np.array([0.25, 0.0, 0.25])
    assert found.length_m == pytest.approx(length_quantile(np.diag(variances)), rel=1e-9)


def test_transforms_are_used_at_recorded_places():
    """Bases are used at their robots' flanges, camera mounts at targets, target mounts at points, for each group."""
    made = simulate(Scenario(samples=4), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    group = with_hand(with_eye(group, base="eye_base"), base="hand_base")
    fitted = SimpleNamespace(
        problem=problem.with_groups([group, group]),
        state=SimpleNamespace(camera_from_target=lambda group, stops: group.hand.base_from_flange),
    )
    expected = {
        "eye_base": group.eye.base_from_flange.translation,
        "hand_base": group.hand.base_from_flange.translation,
        group.eye.mount: group.hand.base_from_flange.translation,
        group.hand.mount: made.cell.targets["board"].target.points,
    }
    for name, places in expected.items():
        found = list(_places(name, made.cell, fitted))
        assert len(found) == 2
        for each in found:
            np.testing.assert_array_equal(each, places)
    assert list(_places("another", made.cell, fitted)) == []


@pytest.mark.parametrize("off", [0.0, 1.0])
def test_pooled_quantile_matches_draws(off):
    """The pooled quantile of three normals matches 40,000 draws of each within a hundredth and the sampling noise."""
    rng = np.random.default_rng(0)
    roots, means = rng.standard_normal((3, 3, 3)), off * rng.standard_normal((3, 3))
    drawn = np.concatenate(
        [mean + rng.standard_normal((40_000, 3)) @ root.T for mean, root in zip(means, roots, strict=True)]
    )
    found = pooled_quantile(roots @ roots.mT, means)
    assert found == pytest.approx(np.quantile(np.linalg.norm(drawn, axis=1), 0.95), rel=0.015)


def test_pooled_quantile_of_exact_values():
    """Exact values have their length as the quantile, alone, twice, and beside an uncertain one."""
    nothing = np.zeros((2, 3, 3))
    assert pooled_quantile(nothing[:1], np.ones((1, 3))) == pytest.approx(np.sqrt(3))
    assert pooled_quantile(nothing, np.ones((2, 3))) == pytest.approx(np.sqrt(3))
    assert pooled_quantile(nothing, np.zeros((2, 3))) == 0
    beside = pooled_quantile(np.array([nothing[0], np.eye(3)]), np.zeros((2, 3)))
    assert beside == pytest.approx(np.sqrt(chi2.ppf(0.9, 3)), rel=1e-3)
