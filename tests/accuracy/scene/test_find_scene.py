"""A scene found from its images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.scene import find_scene as room
from basecal.accuracy.scene.find_scene import Report, find_scene
from basecal.cell import Intrinsics, Unknown
from basecal.estimation.scene.views import SceneCamera, SceneViews, Tracks
from basecal.estimation.settings import Settings
from basecal.geometry import SE3
from basecal.numerics.batch import concatenate
from scene_images import images_of_scene, solved_camera
from scene_points import BASE, LENS, PIXEL, Scene, looks, made_scene


def test_two_cameras_are_joined_into_one_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """The base is found to 3 mm, nothing is reported, and most points are seen by both."""
    scene = made_scene(1, arms=2, count=12, points=220)
    images, report = images_of_scene(scene), Report()
    monkeypatch.setattr(room, "solve_camera", lambda images, camera, _: solved_camera(scene, images, camera))
    fit = find_scene(images, (None, None), "left", report, Settings())
    assert fit is not None
    assert report.findings == []
    assert np.linalg.norm((BASE.inverse() @ fit.state.bases[1]).translation) < 3e-3
    assert fit.tracks.count > 180


def with_fixed_camera(scene: Scene, lens: Intrinsics) -> tuple[Scene, SE3]:
    """The scene with a camera on `world` that takes one image, and its true pose."""
    rng = np.random.default_rng(4)
    at, views, tracks = looks(rng, 1, 0.5)[0], scene.views, scene.tracks
    shown = np.flatnonzero(LENS.sees(at.inverse() @ scene.truth.points))
    pixels = LENS.project(at.inverse() @ scene.truth.points[shown]) + PIXEL * rng.standard_normal((len(shown), 2))
    own = Tracks(np.full(len(shown), len(views)), shown, pixels, np.arange(len(shown)))
    more = SceneViews(
        (*views.cameras, SceneCamera("above", None, Unknown(), lens)),
        views.robots,
        views.bases,
        np.append(views.sample, 99),
        np.append(views.camera, 2),
        np.append(views.robot, -1),
        np.append(views.stop, -1),
        concatenate([views.base_from_flange, SE3.stack([SE3.identity()])]),
        views.stop_robot,
    )
    return replace(scene, views=more, tracks=concatenate([tracks, own])), at


@pytest.mark.parametrize("is_stated", [True, False])
def test_a_camera_beside_the_arms_joins_by_the_points(monkeypatch: pytest.MonkeyPatch, is_stated: bool) -> None:
    """Its pose is found to 2 mm and 0.2 deg if its lens is stated; else it is left out, and why is said."""
    scene, true = with_fixed_camera(made_scene(1, arms=2, count=12, points=220), Intrinsics("fixed", LENS))
    images, report = images_of_scene(scene), Report()
    images = replace(images, is_guessed=(False, False, not is_stated))
    monkeypatch.setattr(room, "solve_camera", lambda images, camera, _: solved_camera(scene, images, camera))
    fit = find_scene(images, (None, None), "left", report, Settings())
    assert fit is not None
    assert [each.about for each in report.findings] == ([] if is_stated else [("above",)])
    assert len(fit.state.mounts) == (3 if is_stated else 2)
    if is_stated:
        off = (true.inverse() @ fit.state.mounts[2]).log()
        assert np.linalg.norm(off[:3]) < 2e-3
        assert np.degrees(np.linalg.norm(off[3:])) < 0.2
