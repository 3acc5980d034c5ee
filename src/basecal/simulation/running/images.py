"""Images of a running cell's camera: rendered without a GPU, with motion blur and noise.

With MuJoCo, images show illuminated arms, table and clutter, which may occlude the target; without it, only the target.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Target
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.simulation.surroundings.drawing import BodyPoses, Surroundings
from basecal.vision.detection import Image
from basecal.vision.draw.backdrop import print_targets
from basecal.vision.draw.led import LedSettings, expose_led, led_levels
from basecal.vision.draw.motion_blur import blur_motion
from basecal.vision.draw.render import RenderSettings, background, checked_size, expose, radiance

_CLUTTER_LEVELS = 6.0  # amplitude of the background's texture, in grey levels
_BOARD_SETTINGS = RenderSettings(texture=_CLUTTER_LEVELS)
_LED_SETTINGS = LedSettings(texture=_CLUTTER_LEVELS / 2)
_DIM_SHARE = 0.08  # brightness of the surroundings in an exposure that is short enough for an LED


@dataclass(frozen=True, eq=False)
class CameraScene:
    """The scene in front of a camera at one time.

    Attributes:
        shape: Shape of the target.
        camera_from_target: Pose of the target.
        reflected: (m, 3) mirror images of the target's points in the camera [m]; m is 0 without a reflection.
        body_poses: Poses of arms and camera in the world; None if only the target is rendered.
    """

    shape: Target
    camera_from_target: SE3
    reflected: Array
    body_poses: BodyPoses | None = None


class CameraView:
    """The images of one camera; the last image without noise is cached, since arms are mostly at rest."""

    def __init__(self, lens: Camera, reflection: float, surroundings: Surroundings | None = None) -> None:
        self._lens, self._reflection, self._surroundings = lens, reflection, surroundings
        self._cached: tuple[CameraScene, bool, Array] | None = None
        self._plain_backdrop: Array | None = None
        self._dim_backdrop: tuple[BodyPoses, Array] | None = None

    def image(
        self, scene_at: Callable[[float], CameraScene], start_s: float, duration_s: float, is_lit: bool, seed: int
    ) -> Image:
        """Render an image, (h, w).

        Args:
            scene_at: Returns the scene at a time [s].
            start_s: Start of the exposure [s].
            duration_s: Duration of the exposure [s].
            is_lit: Whether the LED is on.
            seed: Seed of the noise.
        """
        middle = scene_at(start_s + 0.5 * duration_s)
        shift_px = self._centre(scene_at(start_s + duration_s)) - self._centre(scene_at(start_s))
        levels = blur_motion(self._levels(middle, is_lit), shift_px if np.all(np.isfinite(shift_px)) else np.zeros(2))
        return expose(levels, _BOARD_SETTINGS, seed) if middle.shape.sheets else expose_led(levels, _LED_SETTINGS, seed)

    def close(self) -> None:
        """Close the renderer."""
        if self._surroundings is not None:
            self._surroundings.close()

    def _centre(self, scene: CameraScene) -> Array:
        """Image of the target's centre, (2,) [px]."""
        return self._lens.project((scene.camera_from_target @ scene.shape.points).mean(0))

    def _levels(self, scene: CameraScene, is_lit: bool) -> Array:
        if self._cached is not None:
            previous, was_lit, levels = self._cached
            if was_lit == is_lit and _is_equal(previous, scene):
                return levels
        levels = self._board_image(scene) if scene.shape.sheets else self._led_image(scene, is_lit)
        self._cached = (scene, is_lit, levels)
        return levels

    def _board_image(self, scene: CameraScene) -> Array:
        view = (scene.shape, scene.camera_from_target)
        if self._surroundings is None or scene.body_poses is None:
            return radiance(self._lens, [view], _BOARD_SETTINGS)
        return print_targets(self._lens, [view], self._surroundings.backdrop(scene.body_poses), _BOARD_SETTINGS)

    def _led_image(self, scene: CameraScene, is_lit: bool) -> Array:
        backdrop = self._backdrop(scene)
        if not is_lit:
            return backdrop
        is_visible, is_mirrored = self._visible_points(scene)
        dark = replace(_LED_SETTINGS, background=0.0, texture=0.0)
        light = led_levels(self._lens, (scene.camera_from_target @ scene.shape.points)[is_visible], dark)
        if self._reflection:
            reflected_led = replace(dark, photons=self._reflection * dark.photons)
            light += led_levels(self._lens, scene.reflected[is_mirrored], reflected_led)
        return backdrop + light

    def _backdrop(self, scene: CameraScene) -> Array:
        """The backdrop without the LED."""
        if self._surroundings is not None and scene.body_poses is not None:
            if self._dim_backdrop is None or self._dim_backdrop[0] != scene.body_poses:
                levels = np.asarray(_DIM_SHARE * self._surroundings.backdrop(scene.body_poses).levels, dtype=np.float64)
                self._dim_backdrop = (scene.body_poses, levels)
            return self._dim_backdrop[1]
        if self._plain_backdrop is None:
            self._plain_backdrop = background(
                checked_size(self._lens), _LED_SETTINGS.background, _LED_SETTINGS.texture, 0
            )
        return self._plain_backdrop

    def _visible_points(self, scene: CameraScene) -> tuple[BoolArray, BoolArray]:
        """Which LEDs are visible, and which of their mirror images are."""
        if self._surroundings is None or scene.body_poses is None:
            return np.ones(len(scene.shape.points), dtype=bool), np.ones(len(scene.reflected), dtype=bool)
        points = scene.body_poses.world_from_target @ scene.shape.points
        mirror_points = scene.body_poses.world_from_camera @ scene.reflected
        return self._surroundings.is_visible(scene.body_poses, points), self._surroundings.is_mirrored(
            scene.body_poses, mirror_points
        )


def _is_equal(scene: CameraScene, other_scene: CameraScene) -> bool:
    """Whether two scenes are exactly equal, so that the cached image depends only on the poses."""
    if scene.body_poses is not None:
        return scene.body_poses == other_scene.body_poses
    is_same_view = np.array_equal(scene.camera_from_target.matrix, other_scene.camera_from_target.matrix)
    return is_same_view and np.array_equal(scene.reflected, other_scene.reflected)
