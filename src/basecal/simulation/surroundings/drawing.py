"""Rendering of arms, table, clutter and a target's paper with MuJoCo, through the camera's lens.

All poses are set from outside; MuJoCo simulates no motion. It renders an image without distortion, which is resampled
for the lens. The image has no print of the target: edges of MuJoCo have an error of 0.1 px, those of `vision.draw`
0.001 px. It provides the brightness of the paper, and occlusions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.geometry.rotation import quaternion_from_rotation
from basecal.simulation.surroundings.model import TRAY, Stage, body_names, mjcf
from basecal.vision.draw.backdrop import Backdrop, UndistortedCamera, undistorted_camera

_OWN_BODY_M = 0.02  # distance to an LED below which a hit is its own body
_RAY_LIFT_M = np.array([0.0, 0.0, 1e-3])  # [m] above the tray, so that a ray does not start in it


@dataclass(frozen=True, eq=False)
class BodyPoses:
    """Poses of all bodies at one time.

    Attributes:
        world_from_camera: Pose of the camera.
        world_from_target: Pose of the target.
        world_from_links: Poses of each arm's base and joint frames, by robot, in the order of the stage.
    """

    world_from_camera: SE3
    world_from_target: SE3
    world_from_links: Mapping[str, tuple[SE3, ...]]

    def __eq__(self, other: object) -> bool:
        """Whether all poses are exactly equal."""
        return isinstance(other, BodyPoses) and np.array_equal(self.all_poses.matrix, other.all_poses.matrix)

    @property
    def all_poses(self) -> SE3:
        """Poses of all bodies in the order of the stage, and of the camera."""
        links = [frame for frames in self.world_from_links.values() for frame in frames]
        return SE3.stack([*links, self.world_from_target, self.world_from_camera])


class Surroundings:
    """Renderer of a stage for one camera, in a single thread, which OpenGL requires."""

    def __init__(self, stage: Stage, lens: Camera) -> None:
        self._flat: UndistortedCamera = undistorted_camera(lens)
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._thread.submit(self._open, stage).result()

    def _open(self, stage: Stage) -> None:
        import mujoco

        self._mujoco: Any = mujoco
        fovy = 2 * math.degrees(math.atan(0.5 * self._flat.size_px[1] / self._flat.focal_px))
        self._model: Any = mujoco.MjModel.from_xml_string(mjcf(stage, self._flat.size_px, fovy))
        self._data: Any = mujoco.MjData(self._model)
        self._renderer: Any = mujoco.Renderer(self._model, self._flat.size_px[1], self._flat.size_px[0])
        self._tray: int = -1 if stage.tray is None else self._model.geom(TRAY).id
        bodies = [self._model.body(name) for name in (*body_names(stage), "eye")]
        self._mocap_ids = np.array([int(body.mocapid[0]) for body in bodies])

    def backdrop(self, body_poses: BodyPoses) -> Backdrop:
        """The image without the target's print."""
        return self._thread.submit(self._render, body_poses).result()

    def is_visible(self, body_poses: BodyPoses, points_in_world: Array) -> BoolArray:
        """Whether points, (n, 3) [m], are not occluded in the camera, (n,)."""
        return self._thread.submit(self._visible_mask, body_poses, points_in_world).result()

    def is_mirrored(self, body_poses: BodyPoses, points: Array) -> BoolArray:
        """Whether the camera sees mirror images at `points`, (n, 3) [m], in the tray, (n,)."""
        return self._thread.submit(self._mirrored_mask, body_poses, points).result()

    def close(self) -> None:
        """Close the renderer and its thread."""
        self._thread.submit(self._renderer.close).result()
        self._thread.shutdown()

    def _pose_bodies(self, body_poses: BodyPoses) -> None:
        poses = body_poses.all_poses
        self._data.mocap_pos[self._mocap_ids] = poses.translation
        self._data.mocap_quat[self._mocap_ids] = np.roll(quaternion_from_rotation(poses.rotation), 1, axis=-1)
        self._mujoco.mj_forward(self._model, self._data)

    def _render(self, body_poses: BodyPoses) -> Backdrop:
        self._pose_bodies(body_poses)
        self._renderer.update_scene(self._data, "eye")
        return self._flat.backdrop(self._renderer.render())

    def _visible_mask(self, body_poses: BodyPoses, points_in_world: Array) -> BoolArray:
        self._pose_bodies(body_poses)
        eye = body_poses.world_from_camera.translation
        return np.array([self._is_free(eye, point) for point in points_in_world], dtype=bool)

    def _mirrored_mask(self, body_poses: BodyPoses, points: Array) -> BoolArray:
        self._pose_bodies(body_poses)
        eye, is_seen = body_poses.world_from_camera.translation, []
        for mirror_image in points:
            hit, distance_m = self._cast_ray(eye, mirror_image)
            hit_point = eye + distance_m * (mirror_image - eye) / np.linalg.norm(mirror_image - eye)
            point = mirror_image * [1, 1, -1] + [0, 0, 2 * hit_point[2]]
            is_seen.append(hit == self._tray and hit >= 0 and self._is_free(hit_point + _RAY_LIFT_M, point))
        return np.array(is_seen, dtype=bool)

    def _is_free(self, start: Array, end: Array) -> bool:
        hit, distance_m = self._cast_ray(start, end)
        return hit < 0 or distance_m > float(np.linalg.norm(end - start)) - _OWN_BODY_M

    def _cast_ray(self, start: Array, point: Array) -> tuple[int, float]:
        """Id of the first geometry on a ray through a point, -1 if there is none, and its distance [m]."""
        geometry = np.full(1, -1, dtype=np.int32)
        ray = point - start
        distance_m = self._mujoco.mj_ray(
            self._model, self._data, start, ray / np.linalg.norm(ray), None, True, -1, geometry
        )
        return int(geometry[0]), float(distance_m)
