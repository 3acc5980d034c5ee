"""Images of a random scene, as features with descriptors instead of rendered images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.scene.images import Images
from basecal.accuracy.scene.one_camera import OneCamera, own_views
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.scene.mount_search import MountStart
from basecal.estimation.scene.state import SceneState
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import SE3, Array, BoolArray
from basecal.vision.tracks.features import DESCRIPTOR_LENGTH, Descriptors, Features
from scene_points import LENS, MIDDLE, MOUNT, PIXEL, Scene, made_scene

CLUTTER = 30  # features of each image that show no point
NOISE = 0.02  # of each component of a descriptor: the squared distance between two of one point is about 0.1


def unit_rows(rows: Array) -> Descriptors:
    """Rows of unit length."""
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True), dtype=np.float32)


def random_looks(rng: np.random.Generator, count: int) -> Descriptors:
    """Draw `count` unrelated descriptors."""
    return unit_rows(rng.standard_normal((count, DESCRIPTOR_LENGTH)))


def images_of_scene(scene: Scene, seed: int = 1, looks: tuple[Descriptors, ...] | None = None) -> Images:
    """Make a feature for each image point, and clutter.

    Args:
        scene: A scene with its views and image points.
        seed: Seed of descriptors.
        looks: Descriptors (p, 128) of the points by camera; None draws those that all cameras share.
    """
    rng = np.random.default_rng(seed)
    common = random_looks(rng, scene.tracks.count)
    by_camera = (common,) * len(scene.views.cameras) if looks is None else looks
    features = []
    for view in range(len(scene.views)):
        in_view = scene.tracks.view == view
        own = by_camera[scene.views.camera[view]][scene.tracks.point[in_view]]
        noisy = unit_rows(own + NOISE * rng.standard_normal(own.shape))
        clutter_px = rng.uniform(0, 1, (CLUTTER, 2)) * [1279, 719]
        pixels = np.concatenate([scene.tracks.pixels[in_view], clutter_px])
        order = rng.permutation(len(pixels))
        descriptors = np.concatenate([noisy, random_looks(rng, CLUTTER)])
        features.append(Features(pixels[order], descriptors[order]))
    count = len(scene.views.cameras)
    return Images(scene.views, tuple(features), (LENS,) * count, (False,) * count)


def with_inverted_poses(views: SceneViews, camera: int) -> SceneViews:
    """The views, with poses of one camera's robot recorded as `flange_from_base`."""
    poses = [
        pose.inverse() if index == camera else pose
        for pose, index in zip(views.base_from_flange, views.camera, strict=True)
    ]
    return replace(views, base_from_flange=SE3.stack(poses))


def solved_camera(scene: Scene, images: Images, camera: int) -> OneCamera:
    """The result for a camera's images whose mount and points are the true ones, without a search."""
    views, rows = own_views(scene.views, camera)
    is_own = scene.views.camera[scene.tracks.view] == camera
    local = scene.tracks.view[is_own] - rows[0]
    own = Tracks(local, scene.tracks.point[is_own], scene.tracks.pixels[is_own], scene.tracks.feature[is_own])
    tracks, old = own.take(np.ones(len(own), dtype=bool))
    image_px = [images.features[rows[v]].pixels for v in tracks.view]
    feature = [
        int(np.argmin(np.sum((all_px - px) ** 2, 1))) for all_px, px in zip(image_px, tracks.pixels, strict=True)
    ]
    tracks = replace(tracks, feature=np.array(feature))
    base = scene.truth.bases[camera]
    state = SceneState(
        SE3.stack([MOUNT]),
        SE3.stack([SE3.identity()]),
        (LENS,),
        np.zeros((len(rows), 6)),
        base.inverse() @ scene.truth.points[old],
    )
    empty = np.zeros(0)
    fit = SceneFit(views, tracks, PIXEL, np.zeros((len(rows), 6)), (LENS,), state, empty, empty, empty, empty)
    start = MountStart(MOUNT, LENS, PIXEL)
    return OneCamera(rows, start, fit, 60)


def shown_by(scene: Scene, points: Array, seen_by: tuple[BoolArray, BoolArray], seed: int = 1) -> Scene:
    """The scene with other points, of which each view shows 70 % of those in sight.

    Args:
        scene: A scene of two arms.
        points: (p, 3) in the world [m].
        seen_by: (p,) by camera, whether it can see a point.
        seed: Seed of noise and of hidden points.
    """
    rng = np.random.default_rng(seed)
    world_from_camera = scene.truth.world_from_camera(scene.views)
    view, point, pixels, number = [], [], [], []
    for index, camera in enumerate(scene.views.camera):
        in_camera = world_from_camera[index].inverse() @ points
        visible = np.flatnonzero(LENS.sees(in_camera) & seen_by[camera] & (rng.random(len(points)) < 0.7))
        view += [index] * len(visible)
        point += visible.tolist()
        number += range(len(visible))
        pixels.append(LENS.project(in_camera[visible]) + PIXEL * rng.standard_normal((len(visible), 2)))
    tracks = Tracks(np.array(view), np.array(point), np.concatenate(pixels), np.array(number))
    return Scene(scene.views, tracks, scene.truth.with_points(points))


def repeated_object(is_seen_apart: bool) -> tuple[Scene, tuple[Descriptors, Descriptors]]:
    """Return a scene of two equal objects of 80 points on a table, and descriptors by camera.

    The table has other descriptors for each arm.

    Args:
        is_seen_apart: Whether each arm sees only one of the objects; else both see both.
    """
    rng = np.random.default_rng(7)
    scene = made_scene(6, arms=2, count=12, points=30, noise=0.0)
    object_points = MIDDLE + rng.uniform(-1, 1, (80, 3)) * [0.12, 0.12, 0.05]
    table = MIDDLE + rng.uniform(-0.5, 0.5, (100, 3)) * [1, 1, 0]
    offset = np.array([0.15, 0.1, 0.0])
    points = np.concatenate([object_points - offset, object_points + offset, table])
    object_looks, table_looks = random_looks(rng, 80), [random_looks(rng, 100) for _ in range(2)]
    looks = tuple(np.concatenate([object_looks, object_looks, own]) for own in table_looks)
    is_first, is_second = (np.isin(np.arange(260) // 80, [k, 2, 3]) for k in (0, 1))
    everything = np.ones(260, dtype=bool)
    visible = (is_first, is_second) if is_seen_apart else (everything, everything)
    return shown_by(scene, points, visible), (looks[0], looks[1])


def moved_object() -> tuple[Scene, tuple[Descriptors, Descriptors]]:
    """A scene of a table and an object of 90 points that was moved before the second arm saw it, and descriptors."""
    rng = np.random.default_rng(8)
    scene = made_scene(6, arms=2, count=12, points=30, noise=0.0)
    object_points = MIDDLE + rng.uniform(-1, 1, (90, 3)) * [0.06, 0.06, 0.04]
    table = MIDDLE + rng.uniform(-0.35, 0.35, (160, 3)) * [1, 1, 0]
    offset = np.array([0.15, 0.1, 0.0])
    object_looks, table_looks = random_looks(rng, 90), random_looks(rng, 160)
    looks = np.concatenate([object_looks, object_looks, table_looks])
    is_before, is_after = np.arange(340) < 90, (np.arange(340) >= 90) & (np.arange(340) < 180)
    points = np.concatenate([object_points - offset, object_points + offset, table]) + np.array([0.0, 0.0, 0.06])
    return shown_by(scene, points, (~is_after, ~is_before)), (looks, looks)
