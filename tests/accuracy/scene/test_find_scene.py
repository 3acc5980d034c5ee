"""Tests of `find_scene`."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.scene import find_scene as room
from basecal.accuracy.scene.checks import SAME_SPOT
from basecal.accuracy.scene.find_scene import Report, find_scene
from basecal.accuracy.scene.images import Images
from basecal.cell import Intrinsics, Unknown
from basecal.estimation.scene.views import SceneCamera, SceneViews, Tracks
from basecal.estimation.settings import Settings
from basecal.geometry import SE3
from basecal.numerics.batch import concatenate
from scene_images import images_of_scene, solved_camera
from scene_points import BASE, LENS, PIXEL, Scene, looks, made_scene


@pytest.mark.journey
def test_two_cameras_share_one_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cameras share one scene: the base is found to 3 mm without findings, and most points are seen by both."""
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


@pytest.mark.journey
@pytest.mark.parametrize("is_stated", [True, False])
def test_fixed_camera_is_located_by_points(monkeypatch: pytest.MonkeyPatch, is_stated: bool) -> None:
    """The pose of a camera beside the arms is found to 2 mm and 0.2 deg if its lens is stated.

    Else it is left out with the reason.
    """
    scene, true = with_fixed_camera(made_scene(1, arms=2, count=12, points=220), Intrinsics("fixed", LENS))
    images, report = images_of_scene(scene), Report()
    images = replace(images, is_guessed=(False, False, not is_stated))
    monkeypatch.setattr(room, "solve_camera", lambda images, camera, _: solved_camera(scene, images, camera))
    fit = find_scene(images, (None, None), "left", report, Settings())
    assert fit is not None
    assert [each.about for each in report.findings] == ([] if is_stated else [("above",)])
    for each in report.findings:
        assert (each.severity, each.why) == ("warning", "Its lens is not stated.")
        assert each.do == ("State its intrinsics in cell.yaml.",)
    assert len(fit.state.mounts) == (3 if is_stated else 2)
    if is_stated:
        off = (true.inverse() @ fit.state.mounts[2]).log()
        assert np.linalg.norm(off[:3]) < 2e-3
        assert np.degrees(np.linalg.norm(off[3:])) < 0.2


def test_fixed_camera_with_few_points_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fixed camera that sees too few points is left out with advice, and the scene of the arms is unchanged."""
    scene, _ = with_fixed_camera(made_scene(1, arms=2, count=4, points=60), Intrinsics("fixed", LENS))
    images, report = images_of_scene(scene), Report()
    fit = SimpleNamespace(
        views=images.select_moving().views, tracks=scene.tracks, state=scene.truth, guesses=(LENS,) * 2
    )
    monkeypatch.setattr(room, "locate_camera", lambda *given: None)
    monkeypatch.setattr(Images, "descriptors", lambda self, tracks: None)
    assert room._add_fixed_cameras(images, fit, (None, None), report) is fit
    (found,) = report.findings
    assert found.why == "Its image shows too few points that the arms' cameras see."
    assert found.do == (SAME_SPOT,)


def test_cameras_without_shared_points_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first camera is checked with each other one; without a transform no point is shared."""
    arguments: list[tuple[object, ...]] = []
    monkeypatch.setattr(room, "find_join", lambda images, first, second: second if second == "two" else None)
    monkeypatch.setattr(room, "merged_tracks", lambda ones, joins: joins)
    monkeypatch.setattr(room, "shared_points", lambda views, tracks, index: (7, (2, index)))
    monkeypatch.setattr(room, "join_findings", lambda *given: arguments.append(given) or [])
    cameras = [SimpleNamespace(name=name) for name in ("a", "b", "c")]
    images = SimpleNamespace(views=SimpleNamespace(cameras=cameras))
    assert room._joins(images, ["one", "two", "three"], Report()) == {1: "two"}
    assert arguments == [(("a", "b"), "two", 7, (2, 1)), (("a", "c"), None, 0, (0, 0))]


def test_each_camera_uses_noise_of_its_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each camera is solved from its own images with the noise of its arm; progress is counted from one."""
    monkeypatch.setattr(room, "solve_camera", lambda images, camera, noise: (camera, noise))
    views = SimpleNamespace(camera=np.array([1, 0, 0, 1]), robot=np.array([0, 1, 1, 0]), cameras=("a", "b"))
    progress: list[tuple[int, int]] = []
    settings = SimpleNamespace(report_progress=lambda *given: progress.append(given))
    found = [room._solve_one(SimpleNamespace(views=views), k, ("first", "second"), settings) for k in range(2)]
    assert found == [(0, "second"), (1, "first")]
    assert progress == [(1, 2), (2, 2)]
