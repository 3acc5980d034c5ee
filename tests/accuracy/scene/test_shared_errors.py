"""Tests of scene motion, and of smooth robot errors, which widen mainly the answer of wrong arms."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from basecal.accuracy.scene import shared_errors as room
from basecal.accuracy.scene.shared_errors import (
    Response,
    SceneMotion,
    _profiles,
    _second_moment,
    scene_motion,
    shared_covariance,
    shared_errors,
)
from basecal.estimation.scene.adjust import SceneFit, SceneProblem, scene_fit
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.spread import scene_covariance
from basecal.estimation.scene.state import take_step
from basecal.geometry import SE3, Array
from scene_points import BASE, made_scene, moved_in_time


def sag_pose(pose: SE3, rad_per_m: float) -> SE3:
    """A recorded pose of an arm that sags in proportion to its reach without recording it."""
    x, y, _ = pose.translation
    turn = rad_per_m * np.array([-y, x, 0.0])
    return SE3.exp(np.r_[np.zeros(3), turn]) @ pose


def fit_sagging_arms(rad_per_m: float) -> SceneFit:
    """Two arms, twelve images each."""
    scene = made_scene(2, arms=2, count=12, points=100)
    poses = SE3.stack([sag_pose(pose, rad_per_m) for pose in scene.views.base_from_flange])
    views = replace(scene.views, base_from_flange=poses)
    return fit_scene(views, scene.tracks, scene.truth, scene.truth.lenses, (None, None))


def base_covariances(fit: SceneFit) -> tuple[Array, Array]:
    """Of the second base, without and with smooth errors."""
    where = fit.columns.bases[1]
    without = scene_covariance(fit)
    within = without + shared_covariance(fit, 0) + shared_covariance(fit, 1)
    return without[where, where], within[where, where]


@pytest.mark.journey
def test_sagging_arms_have_wider_sigmas() -> None:
    """With a sag of 3 mrad per metre, the squared Mahalanobis distance of the base is 32, with smooth errors 11."""
    fit = fit_sagging_arms(3e-3)
    off = (BASE.inverse() @ fit.state.bases[1]).log()
    without, within = (float(off @ np.linalg.solve(each, off)) for each in base_covariances(fit))
    assert without > 25
    assert within < 16


@pytest.mark.journey
def test_correct_arms_are_widened_little() -> None:
    """Sigmas of the base of correct arms grow by 1 to 40 %, as the data show hardly any such error."""
    without, within = base_covariances(fit_sagging_arms(0.0))
    assert 1.01 < np.sqrt(np.trace(within[:3, :3]) / np.trace(without[:3, :3])) < 1.4


def test_posterior_weighs_response_and_prior() -> None:
    """With equal information of data and prior, the posterior mean of one error is half of the data's."""
    response = Response(np.array([-8.0]), np.array([[4.0]]), np.array([[0.5]]))
    mean, covariance = response.posterior(np.array([0.25]))
    assert mean == pytest.approx([1.0])
    assert covariance == pytest.approx(np.array([[0.125]]))
    assert response.log_evidence(np.array([0.25])) == pytest.approx(0.5 * 8.0 - 0.5 * np.log(2.0))


WAY = np.array([0.6, 0.8, 0.0])


def motion_of(seed: int, shifts_m: Array) -> SceneMotion:
    """The most likely motion of a scene seen by two arms with ten images each, shifted along a direction."""
    scene = moved_in_time(made_scene(seed, arms=2, count=10, points=100), shifts_m[:, None] * WAY)
    return scene_motion(fit_scene(scene.views, scene.tracks, scene.truth, scene.truth.lenses, (None, None)))


@pytest.mark.journey
@pytest.mark.parametrize("seed", [1, 2])
def test_still_scene_has_no_motion(seed: int) -> None:
    """The chance of a still scene's score is above one in a thousand, as in 20 seeds of 20."""
    assert motion_of(seed, np.zeros(20)).chance > 1e-3


@pytest.mark.journey
def test_steady_motion_is_measured() -> None:
    """A steady motion of 0.5 mm per image, 9.5 mm in all, is measured within a fifth."""
    found = motion_of(1, 5e-4 * np.arange(20))
    assert found.chance < 1e-6
    assert found.first_sample is None
    assert found.length_m == pytest.approx(9.5e-3, rel=0.2)


@pytest.mark.journey
def test_sudden_motion_has_sample_and_length() -> None:
    """A table pushed by 4 mm before sample 5 is found at that sample, within a quarter of the length."""
    found = motion_of(2, np.where(np.arange(20) < 5, 0.0, 4e-3))
    assert found.chance < 1e-6
    assert found.first_sample == 5
    assert found.length_m == pytest.approx(4e-3, rel=0.25)


@pytest.mark.journey
def test_early_end_of_descent_is_no_motion() -> None:
    """A base left 20 um off by an early end of the descent is no motion.

    Between the arms, before sample 10, a motion of the scene equals one of the base.
    """
    scene = made_scene(1, arms=2, count=10, points=100)
    fit = fit_scene(scene.views, scene.tracks, scene.truth, scene.truth.lenses, (None, None))
    columns = fit.columns
    step = np.zeros(len(fit.information))
    base = columns.bases[1]
    assert base is not None
    step[base.start] = 2e-5
    task = SceneProblem(fit.views, fit.tracks, fit.sigma_px, fit.stop_sigma, fit.guesses, tail=fit.tail)
    assert scene_motion(scene_fit(task, take_step(fit.state, columns, step))).chance > 1e-3


def test_second_moments_mix_likely_sigmas() -> None:
    """Second moments mix all likely sigmas by prior and evidence, zero as no error; the squared mean is added."""
    response = Response(np.array([-8.0]), np.array([[4.0]]), np.zeros((1, 1)))
    prior = SimpleNamespace(sigmas=np.array([0.0, 0.5, 1.0]), probabilities=np.array([0.5, 0.2, 0.3]))
    ways = []
    for sigma, share in ((0.5, 0.2), (1.0, 0.3)):
        (mean,), ((variance,),) = response.posterior(np.array([sigma**2]))
        ways.append((share * np.exp(response.log_evidence(np.array([sigma**2]))), variance + mean**2, sigma**2))
    total = 0.5 + sum(weight for weight, _, _ in ways)
    moment, square = _second_moment(response, prior)
    np.testing.assert_allclose(moment, [[sum(weight * each for weight, each, _ in ways) / total]])
    assert square == pytest.approx(sum(weight * each for weight, _, each in ways) / total)


def test_second_moments_are_finite_for_extreme_evidence() -> None:
    """Second moments are finite if stated noise far below the true errors overflows the exponential of the evidence."""
    response = Response(np.array([-1e3]), np.array([[100.0]]), np.zeros((1, 1)))
    prior = SimpleNamespace(sigmas=np.array([0.0, 1.0]), probabilities=np.array([0.5, 0.5]))
    moment, square = _second_moment(response, prior)
    (mean,), ((variance,),) = response.posterior(np.ones(1))
    np.testing.assert_allclose(moment, [[variance + mean**2]])
    assert square == 1.0


def test_motion_profiles_are_steady_or_sudden() -> None:
    """Motions are steady or sudden with three samples on each side, by sample numbers, whatever the stop.

    A camera on the world has none.
    """
    views = SimpleNamespace(
        robot=np.array([0, 0, 0, 1, 1, 1, 1, -1]),
        stop=np.array([0, 1, 2, 3, 4, 5, 6, -1]),
        sample=np.array([10, 30, 50, 20, 40, 60, 70, 99]),
    )
    (first, steady), *steps = _profiles(SimpleNamespace(views=views, stop_sigma=np.zeros((7, 6))))
    assert first is None
    np.testing.assert_allclose(steady * 6, [0, 2, 4, 1, 3, 5, 6])
    assert [number for number, _ in steps] == [40, 50]
    assert [profile.tolist() for _, profile in steps] == [[0, 0, 1, 0, 1, 1, 1], [0, 0, 1, 0, 0, 1, 1]]


def test_smooth_error_is_full_far_from_recorded_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Smooth errors have full variance far from recorded poses and nearly none at them.

    Length errors are known anywhere.
    """
    priors = []
    monkeypatch.setattr(room, "compute_response", lambda fit, by_stop: SimpleNamespace(moves=by_stop))
    monkeypatch.setattr(room, "_second_moment", lambda response, prior: priors.append(prior) or ("moment", 4e-6))
    poses = made_scene(1, count=6, points=20).views.base_from_flange
    views = SimpleNamespace(robot=np.zeros(6, dtype=int), base_from_flange=poses, stop=np.arange(6))
    lengths, smooth = shared_errors(SimpleNamespace(views=views, stop_sigma=np.zeros((6, 6))), 0)
    reach_m2 = np.mean(np.sum(poses.translation**2, 1))
    away = SE3(poses.rotation, poses.translation + 50.0)
    np.testing.assert_allclose(smooth.unseen_m2(away), 4e-6 * reach_m2, rtol=1e-6)
    assert (smooth.unseen_m2(poses) < 0.3 * 4e-6 * reach_m2).all()
    assert not lengths.unseen_m2(away).any()
    np.testing.assert_array_equal(smooth.moves, smooth.flange_jacobian(poses))
    middle, factor = room.smooth_by_place.EFFECT.random.expected.turn
    sigmas = priors[1].sigmas[priors[1].sigmas > 0]
    assert sigmas.min() < middle < sigmas.max()
    assert sigmas.min() * sigmas.max() == pytest.approx(middle**2)
    assert sigmas.max() <= middle * factor**3


def test_most_likely_motion_has_length_of_translation(monkeypatch: pytest.MonkeyPatch) -> None:
    """The most likely motion has the length of its translation.

    Its chance is the best of all profiles times their number, at most one.
    """
    motion = np.array([3e-3, 0.0, 4e-3, 1.0, 2.0, 3.0])
    scores = {None: 5.0, 4: 40.0, 6: 20.0}
    monkeypatch.setattr(room, "_profiles", lambda fit: ((number, number) for number in scores))
    monkeypatch.setattr(
        room, "_score", lambda fit, profile: (scores[profile], motion * (profile or 1), f"at {profile}")
    )
    found = scene_motion(SimpleNamespace())
    assert (found.first_sample, found.step) == (4, "at 4")
    assert found.length_m == pytest.approx(4 * 5e-3)
    assert found.chance == pytest.approx(3 * chi2.sf(40.0, 6))
    scores.update({4: 1.0, 6: 1.0})
    assert scene_motion(SimpleNamespace()).chance == 1.0
