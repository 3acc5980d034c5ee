"""Principal point: the centre of a lens is not as stated."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.effect import NOT_OF_LENSES, ONE, Effect, LensParameter, SimulatedFault, format_with_sigma
from basecal.geometry import Array, Camera

# One that counts from the corner of the first pixel, not from its centre, is half a pixel off, and (w + 1) / 2 a whole.
_USUAL = 1e-3  # of the width of the image


def usual(camera: Camera) -> Array:
    """A share of the image's width [px]."""
    width = camera.size_px[0] if camera.size_px else 2 * camera.parameters[2]
    return np.full(2, _USUAL * width)


def words(stated_lens: Camera, estimated_lens: Camera, sigma: Array) -> str:
    """Words of the error of the principal point."""
    off = (stated_lens.parameters - estimated_lens.parameters)[2:4]
    cx, cy = (format_with_sigma(float(value), float(s)) for value, s in zip(off, sigma[2:4], strict=True))
    return f"cx by {cx} px, cy by {cy} px"


def draw_fault(size: float, camera: Camera) -> Camera:
    """A lens whose centre is to the right and below."""
    shifted = camera.parameters.copy()
    shifted[2:4] += size * np.sqrt(0.5)
    return camera.with_parameters(shifted)


EFFECT = Effect(
    "principal_point",
    lens=LensParameter(slice(2, 4), usual, "assumed: calibrations of one lens differ by a pixel or two", words),
    fault=SimulatedFault("principal-point", "px", ONE, 5.0, "the lens's centre is not as stated", draw_lens=draw_fault),
    absent=NOT_OF_LENSES,
)
