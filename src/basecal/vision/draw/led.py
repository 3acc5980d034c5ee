"""Images of LEDs: photons with a Gaussian point spread, shot noise, read-out noise and rounding."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr

from basecal.geometry import Array, Camera
from basecal.vision.detection import Image
from basecal.vision.draw.render import SceneSettings, background, checked_size, quantise

_REACH_SIGMAS = 8.0  # sigmas of a spot, beyond which its levels are below double precision


@dataclass(frozen=True)
class LedSettings(SceneSettings):
    """Exposure of LEDs and of their scene.

    Attributes:
        photons: Mean number of photons of one LED in an exposure; 0 if it is off.
        spot_px: Sigma of the spot, without the integration over the pixel's square.
        photons_per_level: Number of photons per grey level.
        read_noise: Sigma of the read-out noise, in grey levels.
        scene: Seed of the texture, equal for all images of a scene.
    """

    photons: float = 30_000.0
    spot_px: float = 1.2
    photons_per_level: float = 20.0
    background: float = field(default=10.0, kw_only=True)
    read_noise: float = 1.0
    scene: int = 0


def render_led(camera: Camera, points_in_camera: Array, settings: LedSettings | None = None, seed: int = 0) -> Image:
    """Render an image of LEDs, (h, w), saturated at the highest level.

    Args:
        camera: The lens; `size_px` must be known.
        points_in_camera: Positions of the LEDs, (n, 3) [m]; invisible ones are left out.
        settings: Exposure of the LEDs.
        seed: Seed of the photon and read-out noise.

    Raises:
        InputError: if the camera has no size.
    """
    exposure = settings or LedSettings()
    return expose_led(led_levels(camera, points_in_camera, exposure), exposure, seed)


def expose_led(levels: Array, settings: LedSettings, seed: int) -> Image:
    """Add photon and read-out noise to mean levels, round, and clip to the range of the image, (h, w)."""
    rng = np.random.default_rng([seed, 3])
    photons = rng.poisson(np.maximum(levels, 0.0) * settings.photons_per_level)
    counted = photons / settings.photons_per_level + settings.read_noise * rng.standard_normal(levels.shape)
    return quantise(counted, settings.bits)


def led_levels(camera: Camera, points_in_camera: Array, settings: LedSettings) -> Array:
    """Mean level of each pixel without noise, (h, w).

    Raises:
        InputError: if the camera has no size.
    """
    size_px = checked_size(camera)
    image = background(size_px, settings.background, settings.texture, settings.scene)
    points = np.asarray(points_in_camera, dtype=np.float64).reshape(-1, 3)
    for u, v in camera.project(points[Camera(camera.model, camera.parameters).sees(points)]):
        (columns, across), (rows, down) = (
            _shares(centre, settings.spot_px, extent) for centre, extent in zip((u, v), size_px, strict=True)
        )
        image[rows, columns] += settings.photons / settings.photons_per_level * np.outer(down, across)
    return image


def _shares(centre: float, sigma: float, extent: int) -> tuple[slice, Array]:
    """Pixels within the reach of a spot along an axis, and the share of the spot in each."""
    low = int(np.clip(np.floor(centre - _REACH_SIGMAS * sigma), 0, extent))
    high = int(np.clip(np.ceil(centre + _REACH_SIGMAS * sigma) + 1, low, extent))
    borders = np.arange(low, high + 1) - 0.5
    return slice(low, high), np.diff(ndtr((borders - centre) / sigma))
