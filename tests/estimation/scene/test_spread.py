"""Tests of a scene's covariance: never below that of the model, and wider if parts contradict one another."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from basecal.estimation.scene import spread
from basecal.estimation.scene.adjust import SceneFit, SceneProblem, adjust
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.spread import scene_covariance
from basecal.numerics.batch import take
from scene_points import ARM_M, ARM_RAD, LENS, MOUNT, PIXEL, looks, looks_at_one_point, made_scene, started

NOISE = np.repeat([ARM_M, ARM_RAD], 3)


@cache
def fit_shifted_scene(pull_px: float) -> SceneFit:
    """A scene with the image points of one half shifted along one direction of the world."""
    scene = made_scene(1, count=12)
    pixels = scene.tracks.pixels.copy()
    is_left = scene.truth.points[scene.tracks.point, 1] > 0
    pixels[is_left, 0] += pull_px * np.sin(scene.tracks.view[is_left])
    tracks = replace(scene.tracks, pixels=pixels)
    return adjust(SceneProblem(scene.views, tracks, PIXEL, np.tile(NOISE, (12, 1)), (LENS,)), scene.truth)


@cache
def covariance_of_shifted_scene(pull_px: float) -> np.ndarray:
    """The covariance of `fit_shifted_scene`."""
    return scene_covariance(fit_shifted_scene(pull_px))


def test_sigmas_of_consistent_data_are_near_the_models():
    """Every sigma is that of the model or larger, by half at most."""
    fit = fit_shifted_scene(0.0)
    own = len(covariance_of_shifted_scene(0.0))
    model = np.sqrt(np.diag(np.linalg.inv(fit.information))[:own])
    ratio = np.sqrt(np.diag(covariance_of_shifted_scene(0.0))) / model
    assert ratio.min() > 1 - 1e-9
    assert ratio.max() < 1.5


def test_contradicting_parts_widen_sigmas():
    """If half of the points is shifted by pixels from view to view, sigmas of the mount are larger."""
    sound, pulled = covariance_of_shifted_scene(0.0), covariance_of_shifted_scene(2.0)
    assert np.trace(pulled[:6, :6]) > 1.5 * np.trace(sound[:6, :6])


@pytest.mark.journey
def test_views_aimed_at_one_point_leave_its_distance_unknown() -> None:
    """The mount is ten times as uncertain as with free views, along the direction to that point.

    It is within its ellipsoid.
    """
    sigmas = []
    for look in (looks, looks_at_one_point):
        scene = made_scene(1, count=15, points=120, look=look)
        fit = fit_scene(scene.views, scene.tracks, started(scene, 0.01), (LENS,), (None,))
        covariance = scene_covariance(fit)[:6, :6]
        off = (MOUNT.inverse() @ fit.state.mounts[0]).log()
        assert off @ np.linalg.solve(covariance, off) < 27.9
        variance, axes = np.linalg.eigh(covariance[:3, :3])
        sigmas.append(np.sqrt(variance[-1]))
    assert sigmas[1] > 10 * sigmas[0]
    assert abs(axes[2, -1]) > 0.95


def test_jackknife_of_a_mean_is_its_variance():
    """Each of the numbers is left out once, and a shared change has no effect."""
    numbers = np.random.default_rng(0).normal(3.0, 2.0, 12)
    moves = np.array([np.delete(numbers, k).mean() for k in range(12)])[:, None] - numbers.mean()
    expected = numbers.var(ddof=1) / 12
    np.testing.assert_allclose(spread._jackknife(moves), [[expected]], rtol=1e-9)
    np.testing.assert_allclose(spread._jackknife(moves + 5.0), [[expected]], rtol=1e-9)


@pytest.mark.parametrize(("count", "off"), [(10, 0.3), (2000, 0.1)])
def test_few_parts_are_shrunk_to_their_mean_variance(count, off):
    """With equal variances, ten parts give no distinct directions. With unequal ones, many parts give each its own."""
    rng = np.random.default_rng(1)
    equal = spread._jackknife(rng.standard_normal((count, 6)) / np.sqrt(count - 1))
    np.testing.assert_allclose(equal, np.trace(equal) / 6 * np.eye(6), atol=off * np.trace(equal) / 6)
    own = np.array([1.0, 1.0, 1.0, 9.0])
    found = spread._jackknife(rng.standard_normal((count, 4)) * np.sqrt(own / (count - 1)))
    assert np.trace(found) == pytest.approx(own.sum(), rel=0.5 if count == 10 else 0.05)
    if count == 2000:
        np.testing.assert_allclose(found, np.diag(own), atol=0.5)


def test_parts_without_change_have_no_variance():
    """The result is zero, without a division of zero by zero."""
    np.testing.assert_array_equal(spread._jackknife(np.zeros((4, 3))), np.zeros((3, 3)))


def test_folds_of_views_are_interleaved():
    """Views are split into at most ten folds, or one for each of fewer views.

    Every image point is in exactly one fold, and in one cluster.
    """
    fit = fit_shifted_scene(0.0)
    folds = spread._view_folds(fit)
    assert len(folds) == 10
    assert [sorted({int(v) for v in fit.tracks.view[fold]}) for fold in folds] == [
        [k, k + 10][: 2 if k < 2 else 1] for k in range(10)
    ]
    for parts in (folds, spread._point_clusters(fit)):
        np.testing.assert_array_equal(np.sum(parts, axis=0), 1)
    clusters = spread._point_clusters(fit)
    assert len(clusters) == 10
    for part in clusters:
        assert not set(fit.tracks.point[part]) & set(fit.tracks.point[~part])
    few = replace(fit, views=take(fit.views, np.arange(4)), tracks=fit.tracks.take(fit.tracks.view < 4)[0])
    assert [set(few.tracks.view[fold].tolist()) for fold in spread._view_folds(few)] == [{0}, {1}, {2}, {3}]


def test_sigmas_are_widened_by_the_mean_of_all():
    """The square of the factor is the mean of variances in units of the model's."""
    fit = fit_shifted_scene(2.0)
    covariance = covariance_of_shifted_scene(2.0)
    own = len(covariance)
    root = np.linalg.cholesky(np.linalg.inv(fit.information)[:own, :own])
    whitened = np.linalg.solve(root, np.linalg.solve(root, covariance).T)
    factor = spread.widening_factor(fit)
    assert factor == pytest.approx(np.sqrt(np.mean(np.diag(whitened))))
    assert factor > 1.0
