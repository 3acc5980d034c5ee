"""Images of a running cell's camera: rendered without a GPU, with motion blur and noise.

With MuJoCo, images show illuminated arms, table and clutter, which may occlude the target; without it, only the target.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Target
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.simulation.surroundings.drawing import Scene, Surroundings
from basecal.vision.detection import Image
from basecal.vision.draw.backdrop import print_targets
from basecal.vision.draw.light import LightSettings, expose_light, light_levels
from basecal.vision.draw.motion_blur import blur_motion
from basecal.vision.draw.render import RenderSettings, background, checked_size, expose, radiance

_CLUTTER_LEVELS = 6.0  # amplitude of the background's texture, in grey levels
_BOARD_SETTINGS = RenderSettings(texture=_CLUTTER_LEVELS)
_LIGHT_SETTINGS = LightSettings(texture=_CLUTTER_LEVELS / 2)
_DIM_SHARE = 0.08  # brightness of the surroundings in an exposure that is short enough for an LED


@dataclass(frozen=True, eq=False)
class Seen:
    """The scene in front of a camera at one time.

    Attributes:
        shape: Shape of the target.
        camera_from_target: Pose of the target.
        reflected: (m, 3) mirror images of the target's points in the camera [m]; m is 0 without a reflection.
        scene: Poses of arms and camera in the world; None if only the target is rendered.
    """

    shape: Target
    camera_from_target: SE3
    reflected: Array
    scene: Scene | None = None


class CameraView:
    """The images of one camera; the last image without noise is cached, since arms are mostly at rest."""

    def __init__(self, lens: Camera, reflection: float, surroundings: Surroundings | None = None) -> None:
        self._lens, self._reflection, self._surroundings = lens, reflection, surroundings
        self._kept: tuple[Seen, bool, Array] | None = None
        self._plain: Array | None = None
        self._dim: tuple[Scene, Array] | None = None

    def image(
        self, scene_at: Callable[[float], Seen], start_s: float, lasts_s: float, is_lit: bool, seed: int
    ) -> Image:
        """Render an image, (h, w).

        Args:
            scene_at: Returns the scene at a time [s].
            start_s: Start of the exposure [s].
            lasts_s: Duration of the exposure [s].
            is_lit: Whether the LED is on.
            seed: Seed of the noise.
        """
        middle = scene_at(start_s + 0.5 * lasts_s)
        way = self._centre(scene_at(start_s + lasts_s)) - self._centre(scene_at(start_s))
        levels = blur_motion(self._levels(middle, is_lit), way if np.all(np.isfinite(way)) else np.zeros(2))
        return (
            expose(levels, _BOARD_SETTINGS, seed)
            if middle.shape.sheets
            else expose_light(levels, _LIGHT_SETTINGS, seed)
        )

    def close(self) -> None:
        """Close the renderer."""
        if self._surroundings is not None:
            self._surroundings.close()

    def _centre(self, scene: Seen) -> Array:
        """Image of the target's centre, (2,) [px]."""
        return self._lens.project((scene.camera_from_target @ scene.shape.points).mean(0))

    def _levels(self, scene: Seen, is_lit: bool) -> Array:
        if self._kept is not None:
            before, was_lit, levels = self._kept
            if was_lit == is_lit and _is_equal(before, scene):
                return levels
        levels = self._board_image(scene) if scene.shape.sheets else self._light_image(scene, is_lit)
        self._kept = (scene, is_lit, levels)
        return levels

    def _board_image(self, scene: Seen) -> Array:
        view = (scene.shape, scene.camera_from_target)
        if self._surroundings is None or scene.scene is None:
            return radiance(self._lens, [view], _BOARD_SETTINGS)
        return print_targets(self._lens, [view], self._surroundings.backdrop(scene.scene), _BOARD_SETTINGS)

    def _light_image(self, scene: Seen, is_lit: bool) -> Array:
        behind = self._backdrop(scene)
        if not is_lit:
            return behind
        shown, mirrored = self._visible_points(scene)
        dark = replace(_LIGHT_SETTINGS, background=0.0, texture=0.0)
        light = light_levels(self._lens, (scene.camera_from_target @ scene.shape.points)[shown], dark)
        if self._reflection:
            weaker = replace(dark, photons=self._reflection * dark.photons)
            light += light_levels(self._lens, scene.reflected[mirrored], weaker)
        return behind + light

    def _backdrop(self, scene: Seen) -> Array:
        """The backdrop without the LED."""
        if self._surroundings is not None and scene.scene is not None:
            if self._dim is None or self._dim[0] != scene.scene:
                levels = np.asarray(_DIM_SHARE * self._surroundings.backdrop(scene.scene).levels, dtype=np.float64)
                self._dim = (scene.scene, levels)
            return self._dim[1]
        if self._plain is None:
            self._plain = background(checked_size(self._lens), _LIGHT_SETTINGS.background, _LIGHT_SETTINGS.texture, 0)
        return self._plain

    def _visible_points(self, scene: Seen) -> tuple[BoolArray, BoolArray]:
        """Which LEDs are visible, and which of their mirror images are."""
        if self._surroundings is None or scene.scene is None:
            return np.ones(len(scene.shape.points), dtype=bool), np.ones(len(scene.reflected), dtype=bool)
        points = scene.scene.world_from_target @ scene.shape.points
        below = scene.scene.world_from_camera @ scene.reflected
        return self._surroundings.is_visible(scene.scene, points), self._surroundings.is_mirrored(scene.scene, below)


def _is_equal(scene: Seen, other_scene: Seen) -> bool:
    """Whether two scenes are exactly equal, so that the cached image depends only on the poses."""
    if scene.scene is not None:
        return scene.scene == other_scene.scene
    return np.array_equal(scene.camera_from_target.matrix, other_scene.camera_from_target.matrix)
