"""Two arms whose cameras see a scene of points: image points with known mounts, bases and noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from basecal.cell import Intrinsics, Unknown
from basecal.estimation.scene.state import SceneState
from basecal.estimation.scene.views import SceneCamera, SceneViews, Tracks
from basecal.geometry import SE3, Array, Camera

LENS = Camera("pinhole", np.array([900.0, 900.0, 639.5, 359.5, -0.1, 0.05, 0.0, 0.0, 0.0]), (1280, 720))
MOUNT = SE3.from_rpy((0.05, -0.1, 0.3), (0.04, -0.02, 0.08))
BASE = SE3.from_rpy((0.01, 0.02, 2.9), (1.4, 0.1, 0.05))
ARM_M, ARM_RAD, PIXEL = 2e-4, 3e-4, 0.3
MIDDLE = np.array([0.7, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class Scene:
    """Recorded image points, the true state, and the true poses of the cameras."""

    views: SceneViews
    tracks: Tracks
    truth: SceneState
    world_from_camera: SE3 = field(default_factory=SE3.identity)


def looks(rng: np.random.Generator, count: int, side: float) -> SE3:
    """Poses of a camera in the world that looks down at the middle from one side."""
    poses = []
    for _ in range(count):
        position = MIDDLE + np.array([side * rng.uniform(0.1, 0.5), rng.uniform(-0.4, 0.4), rng.uniform(0.5, 0.9)])
        aim = MIDDLE + rng.uniform(-0.15, 0.15, 3) - position
        z = aim / np.linalg.norm(aim)
        x = np.cross(z, rng.normal(0, 1, 3))
        x /= np.linalg.norm(x)
        poses.append(SE3(np.column_stack([x, np.cross(z, x), z]), position))
    return SE3.stack(poses)


def looks_from_above(rng: np.random.Generator, count: int, side: float) -> SE3:
    """Poses of a camera in the world that looks straight down from one height, at random places above the middle."""
    yaw, offset = rng.uniform(-1, 1, count), rng.uniform(-1, 1, (count, 3)) * [0.3, 0.4, 0.0]
    rotation = SE3.exp(np.outer(yaw, [0.0, 0, 0, 0, 0, 1])).rotation @ np.diag([1.0, -1, -1])
    return SE3(rotation, MIDDLE + offset + [0, 0, 0.7])


def looks_at_one_point(rng: np.random.Generator, count: int, side: float) -> SE3:
    """Poses of a camera in the world whose optical axis goes through the middle, 0.8 m away within 5 mm."""
    poses = looks(rng, count, side)
    away = poses.rotation[..., 2] * (0.8 + rng.uniform(-5e-3, 5e-3, (count, 1)))
    return SE3(poses.rotation, MIDDLE - away)


def made_scene(
    seed: int,
    arms: int = 1,
    count: int = 15,
    points: int = 150,
    noise: float = 1.0,
    look: Callable[[np.random.Generator, int, float], SE3] = looks,
) -> Scene:
    """A table with boxes on it, seen by one or two arms whose errors are the stated ones times `noise`."""
    rng = np.random.default_rng(seed)
    places = MIDDLE + rng.uniform(-1, 1, (points, 3)) * [0.5, 0.5, 0.0]
    places[::3, 2] += rng.uniform(0, 0.25, len(places[::3]))
    bases, flanges, cameras = [SE3.identity(), BASE][:arms], [], []
    for arm, base in enumerate(bases):
        world_from_camera = look(rng, count, -1.0 if arm == 0 else 1.0)
        base_from_flange = base.inverse() @ world_from_camera @ MOUNT.inverse()
        error = SE3.exp(noise * rng.standard_normal((count, 6)) * np.repeat([ARM_M, ARM_RAD], 3))
        flanges.append(base_from_flange @ error)
        cameras.append(world_from_camera)
    names = ("left", "right")[:arms]
    lens = Intrinsics("free", LENS)
    views = SceneViews(
        tuple(SceneCamera(f"{name}_eye", name, Unknown(), lens) for name in names),
        names,
        (Unknown("fixed", SE3.identity()), Unknown())[:arms],
        np.arange(arms * count),
        np.repeat(np.arange(arms), count),
        np.repeat(np.arange(arms), count),
        np.arange(arms * count),
        SE3.stack([pose[k] for pose in flanges for k in range(count)]),
        np.repeat(np.arange(arms), count),
    )
    view_index, point_index, pixels, number = [], [], [], []
    for view in range(arms * count):
        in_camera = cameras[view // count][view % count].inverse() @ places
        visible = np.flatnonzero(LENS.sees(in_camera) & (rng.random(points) < 0.7))
        view_index += [view] * len(visible)
        point_index += visible.tolist()
        number += range(len(visible))
        pixels.append(LENS.project(in_camera[visible]) + noise * PIXEL * rng.standard_normal((len(visible), 2)))
    tracks = Tracks(np.array(view_index), np.array(point_index), np.concatenate(pixels), np.array(number))
    tracks, old = tracks.take(np.ones(len(tracks), dtype=bool))
    errors = np.zeros((arms * count, 6))
    truth = SceneState(SE3.stack([MOUNT] * arms), SE3.stack(bases), (LENS,) * arms, errors, places[old])
    return Scene(views, tracks, truth, SE3.stack([each[k] for each in cameras for k in range(count)]))


def started(scene: Scene, off: float = 0.02) -> SceneState:
    """The true state with an error of norm `off` in each mount and base, without points."""
    truth = scene.truth
    step = SE3.exp(off * np.array([1.0, -1.0, 1.0, 1.0, 1.0, -1.0]) / np.sqrt(6))
    bases = [truth.bases[k] if k == 0 else truth.bases[k] @ step for k in range(len(truth.bases))]
    mounts = SE3.stack([truth.mounts[k] @ step for k in range(len(truth.mounts))])
    return SceneState(mounts, SE3.stack(bases), truth.lenses, truth.errors, np.zeros((0, 3)))


def moved_in_time(scene: Scene, shifts: Array) -> Scene:
    """A scene that moved between views as its cameras did, so that images are the same and flange poses differ.

    Args:
        scene: A scene of arms.
        shifts: (v, 3) of the scene in the world at each view [m].
    """
    views = scene.views
    bases = [scene.truth.bases[k] for k in views.robot]
    rows = zip(bases, views.base_from_flange, shifts, strict=True)
    poses = [base.inverse() @ SE3(np.eye(3), shift) @ base @ flange for base, flange, shift in rows]
    return replace(scene, views=replace(views, base_from_flange=SE3.stack(poses)))
