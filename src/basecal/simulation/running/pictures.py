"""What a camera of a running cell sees: drawn without a GPU, smeared while something moves, with noise.

Where MuJoCo draws, arms, table and clutter stand around the target, hide it, and are lit; else it stands alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Target
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.simulation.surroundings.drawn import Scene, Surroundings
from basecal.vision.detection import Image
from basecal.vision.draw.backdrop import printed_on
from basecal.vision.draw.light import LightSettings, expose_light, light_levels
from basecal.vision.draw.motion_blur import smeared
from basecal.vision.draw.render import RenderSettings, background, checked_size, expose, radiance

_CLUTTER = 6.0  # levels of structure in what stands behind
_BOARD = RenderSettings(texture=_CLUTTER)
_LIGHT = LightSettings(texture=_CLUTTER / 2)
_DIM = 0.08  # of the levels of what stands around, in an exposure short enough for a light


@dataclass(frozen=True, eq=False)
class Seen:
    """What is before a camera at an instant.

    Attributes:
        shape: Of the target.
        camera_from_target: Where it is.
        reflected: (m, 3) where its points are seen again [m]; none where nothing shines.
        scene: Where arms and camera are in the world; None where only the target is drawn.
    """

    shape: Target
    camera_from_target: SE3
    reflected: Array
    scene: Scene | None = None


class CameraView:
    """The pictures of one camera; the last one drawn without noise is kept, since arms mostly stand still."""

    def __init__(self, lens: Camera, reflection: float, around: Surroundings | None = None) -> None:
        self._lens, self._reflection, self._around = lens, reflection, around
        self._kept: tuple[Seen, bool, Array] | None = None
        self._plain: Array | None = None
        self._dim: tuple[Scene, Array] | None = None

    def picture(self, seen_at: Callable[[float], Seen], begin_s: float, lasts_s: float, lit: bool, seed: int) -> Image:
        """A picture, (h, w).

        Args:
            seen_at: What is before the camera at a time [s].
            begin_s: When the shutter opens.
            lasts_s: How long it stays open.
            lit: Whether the light is on.
            seed: Of the noise.
        """
        middle = seen_at(begin_s + 0.5 * lasts_s)
        way = self._centre(seen_at(begin_s + lasts_s)) - self._centre(seen_at(begin_s))
        levels = smeared(self._levels(middle, lit), way if np.all(np.isfinite(way)) else np.zeros(2))
        return expose(levels, _BOARD, seed) if middle.shape.sheets else expose_light(levels, _LIGHT, seed)

    def close(self) -> None:
        """Let go of what draws."""
        if self._around is not None:
            self._around.close()

    def _centre(self, seen: Seen) -> Array:
        """Where the target's middle is in the picture, (2,) [px]."""
        return self._lens.project((seen.camera_from_target @ seen.shape.points).mean(0))

    def _levels(self, seen: Seen, lit: bool) -> Array:
        if self._kept is not None:
            before, was_lit, levels = self._kept
            if was_lit == lit and _is_alike(before, seen):
                return levels
        levels = self._of_board(seen) if seen.shape.sheets else self._of_light(seen, lit)
        self._kept = (seen, lit, levels)
        return levels

    def _of_board(self, seen: Seen) -> Array:
        view = (seen.shape, seen.camera_from_target)
        if self._around is None or seen.scene is None:
            return radiance(self._lens, [view], _BOARD)
        return printed_on(self._lens, [view], self._around.backdrop(seen.scene), _BOARD)

    def _of_light(self, seen: Seen, lit: bool) -> Array:
        behind = self._behind(seen)
        if not lit:
            return behind
        shown, mirrored = self._shown(seen)
        dark = replace(_LIGHT, background=0.0, texture=0.0)
        light = light_levels(self._lens, (seen.camera_from_target @ seen.shape.points)[shown], dark)
        if self._reflection:
            weaker = replace(dark, photons=self._reflection * dark.photons)
            light += light_levels(self._lens, seen.reflected[mirrored], weaker)
        return behind + light

    def _behind(self, seen: Seen) -> Array:
        """What there is without the light."""
        if self._around is not None and seen.scene is not None:
            if self._dim is None or self._dim[0] != seen.scene:
                levels = np.asarray(_DIM * self._around.backdrop(seen.scene).levels, dtype=np.float64)
                self._dim = (seen.scene, levels)
            return self._dim[1]
        if self._plain is None:
            self._plain = background(checked_size(self._lens), _LIGHT.background, _LIGHT.texture, 0)
        return self._plain

    def _shown(self, seen: Seen) -> tuple[BoolArray, BoolArray]:
        """Which points of a light nothing hides, directly and again."""
        if self._around is None or seen.scene is None:
            return np.ones(len(seen.shape.points), dtype=bool), np.ones(len(seen.reflected), dtype=bool)
        points = seen.scene.world_from_target @ seen.shape.points
        below = seen.scene.world_from_camera @ seen.reflected
        return self._around.shines(seen.scene, points), self._around.mirrored(seen.scene, below)


def _is_alike(one: Seen, other: Seen) -> bool:
    """Whether two are the same to the last bit: what is drawn then follows from where things are, and nothing else."""
    if one.scene is not None:
        return one.scene == other.scene
    return np.array_equal(one.camera_from_target.matrix, other.camera_from_target.matrix)
