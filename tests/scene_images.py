"""Images of a made-up scene: features with descriptors in place of rendered images."""

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
NOISE = 0.02  # of each number of a descriptor: two of one point are 0.1 apart, squared


def unit_rows(rows: Array) -> Descriptors:
    """Rows of unit length."""
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True), dtype=np.float32)


def random_looks(rng: np.random.Generator, count: int) -> Descriptors:
    """So many descriptors that have nothing to do with one another."""
    return unit_rows(rng.standard_normal((count, DESCRIPTOR_LENGTH)))


def images_of_scene(scene: Scene, seed: int = 1, looks: tuple[Descriptors, ...] | None = None) -> Images:
    """A feature for each image point, and clutter.

    Args:
        scene: Its views and image points.
        seed: Of descriptors.
        looks: (p, 128) of the points, by camera; drawn, one for all cameras, if None.
    """
    rng = np.random.default_rng(seed)
    of_all = random_looks(rng, scene.tracks.count)
    by_camera = (of_all,) * len(scene.views.cameras) if looks is None else looks
    features = []
    for view in range(len(scene.views)):
        mine = scene.tracks.view == view
        own = by_camera[scene.views.camera[view]][scene.tracks.point[mine]]
        shown = unit_rows(own + NOISE * rng.standard_normal(own.shape))
        beside = rng.uniform(0, 1, (CLUTTER, 2)) * [1279, 719]
        pixels = np.concatenate([scene.tracks.pixels[mine], beside])
        order = rng.permutation(len(pixels))
        descriptors = np.concatenate([shown, random_looks(rng, CLUTTER)])
        features.append(Features(pixels[order], descriptors[order]))
    count = len(scene.views.cameras)
    return Images(scene.views, tuple(features), (LENS,) * count, (False,) * count)


def with_inverted_poses(views: SceneViews, camera: int) -> SceneViews:
    """The views, poses of one camera's robot recorded as `flange_from_base`."""
    poses = [
        pose.inverse() if of == camera else pose for pose, of in zip(views.base_from_flange, views.camera, strict=True)
    ]
    return replace(views, base_from_flange=SE3.stack(poses))


def solved_camera(scene: Scene, images: Images, camera: int) -> OneCamera:
    """What a camera's images say if its mount and points are the true ones, without a search."""
    views, rows = own_views(scene.views, camera)
    mine = scene.views.camera[scene.tracks.view] == camera
    local = scene.tracks.view[mine] - rows[0]
    own = Tracks(local, scene.tracks.point[mine], scene.tracks.pixels[mine], scene.tracks.feature[mine])
    tracks, old = own.take(np.ones(len(own), dtype=bool))
    at = [images.features[rows[v]].pixels for v in tracks.view]
    feature = [int(np.argmin(np.sum((all_px - px) ** 2, 1))) for all_px, px in zip(at, tracks.pixels, strict=True)]
    tracks = replace(tracks, feature=np.array(feature))
    base = scene.truth.bases[camera]
    state = SceneState(
        SE3.stack([MOUNT]),
        SE3.stack([SE3.identity()]),
        (LENS,),
        np.zeros((len(rows), 6)),
        base.inverse() @ scene.truth.points[old],
    )
    nothing = np.zeros(0)
    fit = SceneFit(views, tracks, PIXEL, np.zeros((len(rows), 6)), (LENS,), state, nothing, nothing, nothing, nothing)
    start = MountStart(MOUNT, LENS, PIXEL)
    return OneCamera(rows, start, fit, 60)


def shown_by(scene: Scene, points: Array, seen_by: tuple[BoolArray, BoolArray], seed: int = 1) -> Scene:
    """Other points before the cameras of a scene without noise, 70 % of those in view.

    Args:
        scene: Of two arms.
        points: (p, 3) in the world [m].
        seen_by: (p,) by camera, whether anything of it is seen.
        seed: Of noise and of what is hidden.
    """
    rng = np.random.default_rng(seed)
    world_from_camera = scene.truth.world_from_camera(scene.views)
    view, point, pixels, number = [], [], [], []
    for index, camera in enumerate(scene.views.camera):
        at = world_from_camera[index].inverse() @ points
        visible = np.flatnonzero(LENS.sees(at) & seen_by[camera] & (rng.random(len(points)) < 0.7))
        view += [index] * len(visible)
        point += visible.tolist()
        number += range(len(visible))
        pixels.append(LENS.project(at[visible]) + PIXEL * rng.standard_normal((len(visible), 2)))
    tracks = Tracks(np.array(view), np.array(point), np.concatenate(pixels), np.array(number))
    return Scene(scene.views, tracks, scene.truth.with_points(points))


def repeated_object(is_seen_apart: bool) -> tuple[Scene, tuple[Descriptors, Descriptors]]:
    """An object of 80 points that stands twice, and a table that looks otherwise to each arm.

    Args:
        is_seen_apart: Whether each arm sees another one of the two; else both see both.
    """
    rng = np.random.default_rng(7)
    scene = made_scene(6, arms=2, count=12, points=30, noise=0.0)
    thing = MIDDLE + rng.uniform(-1, 1, (80, 3)) * [0.12, 0.12, 0.05]
    table = MIDDLE + rng.uniform(-0.5, 0.5, (100, 3)) * [1, 1, 0]
    aside = np.array([0.15, 0.1, 0.0])
    points = np.concatenate([thing - aside, thing + aside, table])
    of_thing, of_table = random_looks(rng, 80), [random_looks(rng, 100) for _ in range(2)]
    looks = tuple(np.concatenate([of_thing, of_thing, own]) for own in of_table)
    is_first, is_second = (np.isin(np.arange(260) // 80, [k, 2, 3]) for k in (0, 1))
    every = np.ones(260, dtype=bool)
    seen = (is_first, is_second) if is_seen_apart else (every, every)
    return shown_by(scene, points, seen), (looks[0], looks[1])


def moved_object() -> tuple[Scene, tuple[Descriptors, Descriptors]]:
    """A table, and an object of 90 points on it that stood elsewhere when the second arm looked."""
    rng = np.random.default_rng(8)
    scene = made_scene(6, arms=2, count=12, points=30, noise=0.0)
    thing = MIDDLE + rng.uniform(-1, 1, (90, 3)) * [0.06, 0.06, 0.04]
    table = MIDDLE + rng.uniform(-0.35, 0.35, (160, 3)) * [1, 1, 0]
    aside = np.array([0.15, 0.1, 0.0])
    of_thing, of_table = random_looks(rng, 90), random_looks(rng, 160)
    looks = np.concatenate([of_thing, of_thing, of_table])
    of_first, of_second = np.arange(340) < 90, (np.arange(340) >= 90) & (np.arange(340) < 180)
    points = np.concatenate([thing - aside, thing + aside, table]) + np.array([0.0, 0.0, 0.06])
    return shown_by(scene, points, (~of_second, ~of_first)), (looks, looks)
