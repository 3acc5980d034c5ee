"""The covariance of a scene is never below that of the model, and parts that contradict one another widen it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.scene.adjust import SceneFit, Task, adjust
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.spread import scene_covariance
from scene_points import ARM_M, ARM_RAD, LENS, MOUNT, PIXEL, looks, looks_at_one_point, made_scene, started

NOISE = np.repeat([ARM_M, ARM_RAD], 3)


def fitted(pull_px: float) -> SceneFit:
    """A scene, the image points of one half of which are pulled by so much in one direction of the world."""
    scene = made_scene(1, count=12)
    pixels = scene.tracks.pixels.copy()
    is_left = scene.truth.points[scene.tracks.point, 1] > 0
    pixels[is_left, 0] += pull_px * np.sin(scene.tracks.view[is_left])
    tracks = replace(scene.tracks, pixels=pixels)
    return adjust(Task(scene.views, tracks, PIXEL, np.tile(NOISE, (12, 1)), (LENS,)), scene.truth)


def test_sigmas_of_sound_data_are_nearly_those_of_the_model():
    """Every sigma is that of the model or larger, by half at most."""
    fit = fitted(0.0)
    own = len(scene_covariance(fit))
    model = np.sqrt(np.diag(np.linalg.inv(fit.information))[:own])
    ratio = np.sqrt(np.diag(scene_covariance(fit))) / model
    assert ratio.min() > 1 - 1e-9
    assert ratio.max() < 1.5


def test_contradicting_parts_widen_sigmas():
    """Where half of the points is pulled by a pixel from view to view, sigmas of the mount are larger."""
    sound, pulled = scene_covariance(fitted(0.0)), scene_covariance(fitted(2.0))
    assert np.trace(pulled[:6, :6]) > 1.5 * np.trace(sound[:6, :6])


def test_views_that_aim_at_one_point_leave_the_distance_to_it_unknown() -> None:
    """The mount is ten times as uncertain as of free views, along the way to that point, and within its ellipsoid."""
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
