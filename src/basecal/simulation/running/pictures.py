"""What a camera of a running cell sees: drawn without a GPU, smeared while something moves, with noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Target
from basecal.geometry import SE3, Array, Camera
from basecal.vision.detection import Image
from basecal.vision.draw.light import LightSettings, expose_light, light_levels
from basecal.vision.draw.motion_blur import smeared
from basecal.vision.draw.render import RenderSettings, background, checked_size, expose, radiance

_CLUTTER = 6.0  # levels of structure in what stands behind
_BOARD = RenderSettings(texture=_CLUTTER)
_LIGHT = LightSettings(texture=_CLUTTER / 2)


@dataclass(frozen=True, eq=False)
class Seen:
    """What is before a camera at an instant.

    Attributes:
        shape: Of the target.
        camera_from_target: Where it is.
        reflected: (m, 3) where its points are seen again in the table [m]; none where nothing shines.
    """

    shape: Target
    camera_from_target: SE3
    reflected: Array


class CameraView:
    """The pictures of one camera; the last one drawn without noise is kept, since arms mostly stand still."""

    def __init__(self, lens: Camera, reflection: float) -> None:
        self._lens, self._reflection = lens, reflection
        self._kept: tuple[SE3, bool, Array] | None = None
        self._plain: Array | None = None

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

    def _centre(self, seen: Seen) -> Array:
        """Where the target's middle is in the picture, (2,) [px]."""
        return self._lens.project((seen.camera_from_target @ seen.shape.points).mean(0))

    def _levels(self, seen: Seen, lit: bool) -> Array:
        if self._kept is not None:
            pose, was_lit, levels = self._kept
            # To the last bit, so that what is drawn follows from where things are, not from what was drawn before.
            if was_lit == lit and np.array_equal(pose.matrix, seen.camera_from_target.matrix):
                return levels
        levels = self._drawn(seen, lit)
        self._kept = (seen.camera_from_target, lit, levels)
        return levels

    def _drawn(self, seen: Seen, lit: bool) -> Array:
        if seen.shape.sheets:
            return radiance(self._lens, [(seen.shape, seen.camera_from_target)], _BOARD)
        if self._plain is None:
            self._plain = background(checked_size(self._lens), _LIGHT.background, _LIGHT.texture, 0)
        if not lit:
            return self._plain
        dark = replace(_LIGHT, background=0.0, texture=0.0)
        light = light_levels(self._lens, seen.camera_from_target @ seen.shape.points, dark)
        if self._reflection:
            light += light_levels(self._lens, seen.reflected, replace(dark, photons=self._reflection * dark.photons))
        return self._plain + light
