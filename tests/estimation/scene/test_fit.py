"""Tests of mounts, lenses and bases of a scene with their covariance, and of excluded gross errors."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.estimation.scene import fit as module
from basecal.estimation.scene.adjust import SceneProblem, adjust, residuals_px
from basecal.estimation.scene.equations import pixel_equations, point_information
from basecal.estimation.scene.fit import fit_scene, triangulate
from basecal.estimation.scene.spread import scene_covariance
from basecal.estimation.scene.views import Tracks
from basecal.geometry import SE3
from basecal.numerics.batch import take
from scene_points import ARM_M, ARM_RAD, BASE, LENS, MOUNT, PIXEL, made_scene, started

NOISE = np.repeat([ARM_M, ARM_RAD], 3)


@pytest.mark.journey
def test_two_arms_are_calibrated_from_unknown_points():
    """Mounts and the base are within their 99.99 % ellipsoids (27.9 for 6), and sigmas are near the truth."""
    scene = made_scene(1, arms=2)
    fit = fit_scene(scene.views, scene.tracks, started(scene), (LENS, LENS), (None, None))
    columns, covariance = fit.columns, scene_covariance(fit)
    for found, true, where in (
        (fit.state.mounts[0], MOUNT, columns.mounts[0]),
        (fit.state.mounts[1], MOUNT, columns.mounts[1]),
        (fit.state.bases[1], BASE, columns.bases[1]),
    ):
        off = (true.inverse() @ found).log()
        assert off @ np.linalg.solve(covariance[where, where], off) < 27.9
        assert np.linalg.norm(off[:3]) < 2e-3
    assert fit.sigma_px == pytest.approx(PIXEL, rel=0.1)
    assert ARM_RAD / 2.5 < fit.stop_sigma[0, 3] < 2.5 * ARM_RAD


@pytest.mark.journey
def test_gross_errors_are_left_out():
    """One image point in ten is 30 px off: the mount stays within its ellipsoid, and these points are removed."""
    scene = made_scene(2)
    rng = np.random.default_rng(5)
    wrong = rng.random(len(scene.tracks)) < 0.1
    pixels = scene.tracks.pixels + np.where(wrong[:, None], rng.normal(0, 30, scene.tracks.pixels.shape), 0.0)
    tracks = replace(scene.tracks, pixels=pixels)
    fit = fit_scene(scene.views, tracks, started(scene), (LENS,), (NOISE,))
    off = (MOUNT.inverse() @ fit.state.mounts[0]).log()
    where = fit.columns.mounts[0]
    assert off @ np.linalg.solve(scene_covariance(fit)[where, where], off) < 27.9
    assert np.abs(residuals_px(fit.views, fit.tracks, fit.state)).max() < 6 * PIXEL


def test_scene_without_remaining_points_is_refused():
    """Image points without any rays that meet in front of the cameras raise LinAlgError."""
    scene = made_scene(2, count=5, points=40)
    rng = np.random.default_rng(6)
    anywhere = rng.uniform(0, 700, scene.tracks.pixels.shape)
    tracks = replace(scene.tracks, pixels=anywhere)
    with pytest.raises(np.linalg.LinAlgError):
        fit_scene(scene.views, tracks, started(scene), (LENS,), (None,))


@pytest.mark.parametrize("more", [0, 1])
def test_points_need_more_equations_than_unknowns(more):
    """Each image point has two equations, and its point in space takes three."""
    tracks = made_scene(1).tracks
    count = 2 * len(tracks) - 3 * tracks.count
    columns = SimpleNamespace(errors=slice(count - more, None))
    task = SimpleNamespace(tracks=tracks, columns=columns)
    if more:
        module._check_points(task)
    else:
        with pytest.raises(np.linalg.LinAlgError, match="too few points"):
            module._check_points(task)


def test_points_of_known_depth_are_kept():
    """Points with a sigma just below a fifth of their distances are kept, and those just above are not.

    The sigma of image points is chosen accordingly.
    """
    scene = made_scene(1)
    fit = adjust(SceneProblem(scene.views, scene.tracks, PIXEL, np.tile(NOISE, (15, 1)), (LENS,)), scene.truth)
    first = np.flatnonzero(fit.tracks.point == 0)
    centres = fit.state.world_from_camera(fit.views).translation[fit.tracks.view[first]]
    distances_m = np.linalg.norm(fit.state.points[0] - centres, axis=1)
    equations = pixel_equations(fit.views, fit.tracks, fit.state, 1.0)
    sigma_m = np.sqrt(np.trace(np.linalg.inv(point_information(fit.tracks, equations)[0])))  # for a sigma of one pixel
    for far_m, is_kept in ((0.199 * distances_m.min(), True), (0.201 * distances_m.max(), False)):
        noisy = replace(fit, sigma_px=far_m / sigma_m)
        _, state = module._without_gross(noisy, np.inf)
        assert np.any(np.all(state.points == fit.state.points[0], axis=1)) == is_kept


def test_exact_rays_meet_in_their_points():
    """Without noise all points are found to a micrometre, and are marked as seen."""
    scene = made_scene(1, noise=0.0)
    points, is_seen = triangulate(scene.views, scene.tracks, scene.truth)
    assert is_seen.all()
    assert np.abs(points - scene.truth.points).max() < 1e-6


def test_rays_of_one_place_have_no_depth():
    """A point in one view, repeated as in three equal views, is not marked as seen."""
    scene = made_scene(2, noise=0.0)
    same = take(scene.views, np.zeros(3, dtype=np.int64))
    one = np.flatnonzero(scene.tracks.view == 0)[0]
    tracks = Tracks(
        np.arange(3),
        np.zeros(3, dtype=np.int64),
        np.tile(scene.tracks.pixels[one], (3, 1)),
        np.zeros(3, dtype=np.int64),
    )
    assert not triangulate(same, tracks, scene.truth)[1].any()


@pytest.mark.parametrize(("points", "views", "share"), [(11, 0, 0.67), (5, 10, 0.25), (0, 15, 0.1), (300, 50, 0.1)])
def test_robust_sigma_is_corrected_for_unknowns(monkeypatch, points, views, share):
    """Among 100 equations each point takes three and each view six, but at most nine in ten.

    Infinite residuals do not count.
    """
    off = np.random.default_rng(0).standard_normal((50, 2))
    off[0] = np.inf
    monkeypatch.setattr(module, "residuals_px", lambda *_: off)
    fit = SimpleNamespace(tracks=SimpleNamespace(count=points), views=range(views), state=None)
    plain = 1.4826 * np.median(np.abs(off[1:]))
    assert module._robust_sigma(fit) == pytest.approx(plain / np.sqrt(share), rel=1e-4)


@pytest.mark.parametrize("behind", [False, True])
def test_points_behind_a_camera_are_lost(behind):
    """A point is kept if it is in front of all its cameras.

    It is lost if one looks the other way along the same ray.
    """
    scene = made_scene(1, noise=0.0)
    turned = scene.truth.lenses[0], SE3.from_rotvec((0.0, np.pi, 0.0), np.zeros(3))
    view = int(scene.tracks.view[np.flatnonzero(scene.tracks.point == 0)[0]])
    poses = list(scene.views.base_from_flange)
    if behind:
        mount = scene.truth.mounts[0]
        poses[view] = poses[view] @ mount @ turned[1] @ mount.inverse()
    mirrored = scene.tracks.pixels.copy()
    of_view = scene.tracks.view == view
    if behind:  # a half turn about y mirrors the ray: x is unchanged, y changes its sign
        rays = LENS.undistort(mirrored[of_view])[0] * [1.0, -1.0, 1.0]
        mirrored[of_view] = LENS.project(rays)
    views = replace(scene.views, base_from_flange=type(scene.views.base_from_flange).stack(poses))
    points, is_seen = triangulate(views, replace(scene.tracks, pixels=mirrored), scene.truth)
    shown = np.isin(np.arange(len(points)), scene.tracks.point[of_view])
    assert np.array_equal(is_seen, ~shown if behind else np.ones(len(points), dtype=bool))
