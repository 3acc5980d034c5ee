"""A scene that moves while it is seen is found, by how much and when."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.scene.motion import SceneMotion, scene_motion
from basecal.estimation.scene.adjust import Task, scene_fit
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.state import take_step
from basecal.geometry import Array
from scene_points import made_scene, moved_in_time

WAY = np.array([0.6, 0.8, 0.0])


def motion_of(seed: int, shifts_m: Array) -> SceneMotion:
    """The most likely motion of a scene that two arms see, ten images each, shifted by so much along a way."""
    scene = moved_in_time(made_scene(seed, arms=2, count=10, points=100), shifts_m[:, None] * WAY)
    return scene_motion(fit_scene(scene.views, scene.tracks, scene.truth, scene.truth.lenses, (None, None)))


@pytest.mark.parametrize("seed", [1, 2])
def test_a_still_scene_does_not_move(seed: int) -> None:
    """The chance of its score is above one in a thousand, as it is of 20 seeds of 20."""
    assert motion_of(seed, np.zeros(20)).chance > 1e-3


def test_a_steady_motion_is_measured() -> None:
    """Of 0.5 mm from image to image, 9.5 mm in all, the length is found to a fifth."""
    found = motion_of(1, 5e-4 * np.arange(20))
    assert found.chance < 1e-6
    assert found.first_sample is None
    assert found.length_m == pytest.approx(9.5e-3, rel=0.2)


def test_a_sudden_motion_is_named_by_its_sample() -> None:
    """A table that is pushed by 4 mm before sample 5 is found, to a quarter of that."""
    found = motion_of(2, np.where(np.arange(20) < 5, 0.0, 4e-3))
    assert found.chance < 1e-6
    assert found.first_sample == 5
    assert found.length_m == pytest.approx(4e-3, rel=0.25)


def test_a_descent_that_ends_early_is_no_motion() -> None:
    """The base is left 20 um off. Between the arms, before sample 10, a motion of the scene is one of the base."""
    scene = made_scene(1, arms=2, count=10, points=100)
    fit = fit_scene(scene.views, scene.tracks, scene.truth, scene.truth.lenses, (None, None))
    columns = fit.columns
    step = np.zeros(len(fit.information))
    base = columns.bases[1]
    assert base is not None
    step[base.start] = 2e-5
    task = Task(fit.views, fit.tracks, fit.sigma_px, fit.stop_sigma, fit.guesses, tail=fit.tail)
    assert scene_motion(scene_fit(task, take_step(fit.state, columns, step))).chance > 1e-3
