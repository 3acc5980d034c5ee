"""Focal length: the focal length of a lens differs from the stated one."""

from __future__ import annotations

from basecal.effects.faces.effect import NOT_OF_LENSES, Effect, LensParameter, SimulatedFault, format_with_sigma
from basecal.geometry import Array, Camera

_USUAL = 2e-3  # share of the focal length
_PERCENT = 1e-2


def typical_sigmas(camera: Camera) -> Array:
    """Typical errors of the focal lengths, (2,) [px]."""
    return _USUAL * camera.parameters[:2]


def words(stated_lens: Camera, estimated_lens: Camera, sigma: Array) -> str:
    """Describe the errors of the focal lengths."""
    share = 100 / stated_lens.parameters[:2]
    error = share * (stated_lens.parameters - estimated_lens.parameters)[:2]
    fx, fy = (format_with_sigma(float(value), float(s)) for value, s in zip(error, share * sigma[:2], strict=True))
    return f"fx is off by {fx} %, fy by {fy} %"


def faulty_lens(size: float, camera: Camera) -> Camera:
    """A lens whose focal lengths are larger by a fraction `size`."""
    longer = camera.parameters.copy()
    longer[:2] *= 1 + size
    return camera.with_parameters(longer)


EFFECT = Effect(
    "focal_length",
    lens=LensParameter(
        slice(0, 2), typical_sigmas, "assumed: calibrations of one lens by boards differ by as much", words
    ),
    fault=SimulatedFault("focal-length", "%", _PERCENT, 1.0, "the lens is longer than stated", true_lens=faulty_lens),
    absent=NOT_OF_LENSES,
)
