"""Principal point: the principal point of a lens differs from the stated one."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.effect import NOT_OF_LENSES, ONE, Effect, LensParameter, SimulatedFault, format_with_sigma
from basecal.geometry import Array, Camera

# Pixels counted from the corner of the first pixel instead of its centre shift it by 0.5 px, (w + 1) / 2 by 1 px.
_USUAL = 1e-3  # share of the image's width


def typical_sigmas(camera: Camera) -> Array:
    """Typical errors of the principal point, (2,) [px]."""
    width = camera.size_px[0] if camera.size_px else 2 * camera.parameters[2]
    return np.full(2, _USUAL * width)


def words(stated_lens: Camera, estimated_lens: Camera, sigma: Array) -> str:
    """Describe the error of the principal point."""
    error = (stated_lens.parameters - estimated_lens.parameters)[2:4]
    cx, cy = (format_with_sigma(float(value), float(s)) for value, s in zip(error, sigma[2:4], strict=True))
    return f"cx by {cx} px, cy by {cy} px"


def faulty_lens(size: float, camera: Camera) -> Camera:
    """A lens whose principal point is shifted to the right and down by `size` [px]."""
    shifted = camera.parameters.copy()
    shifted[2:4] += size * np.sqrt(0.5)
    return camera.with_parameters(shifted)


EFFECT = Effect(
    "principal_point",
    lens=LensParameter(
        slice(2, 4), typical_sigmas, "assumed: calibrations of one lens differ by a pixel or two", words
    ),
    fault=SimulatedFault(
        "principal-point", "px", ONE, 5.0, "the lens's centre is not as stated", true_lens=faulty_lens
    ),
    absent=NOT_OF_LENSES,
)
