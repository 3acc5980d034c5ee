"""`noise` of `calibration.json`: which sigmas it may hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, Field, create_model

from basecal.effects.faces.effect import RandomEffect
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.fields.file_forms import THREE, Number, Real, Sigma, Whole, as_written

_Sigma3 = Annotated[list[Sigma | None], THREE]
_Sigma6 = Annotated[list[Sigma | None], Field(min_length=6, max_length=6)]


class _Measured(BaseModel):
    """Sigmas of what cameras measure."""

    pixel_px: Sigma | None = None
    pose_m: Sigma | None = None
    pose_rad: Sigma | None = None
    point_m: Sigma | None = None
    touch_m: Sigma | None = None
    grip_rad: Sigma | None = None


class _Camera(_Measured):
    factor: Real | None
    views_count: Whole


class _Robot(BaseModel):
    """Sigmas of each stop alone; errors that stops share have the name of their effect."""

    sigma_t_m: _Sigma3
    sigma_r_rad: _Sigma3
    rms_factor: Sigma | None = None
    freedoms: Annotated[Real, Field(ge=1)] | None = None


class _Clock(BaseModel):
    jitter_s: Sigma | None


class _Target(BaseModel):
    shape: list[Number]


def _shared_entry(name: str, effect: RandomEffect) -> Any:
    """The entry of an effect: its sigmas, and its figures."""
    of_errors = () if effect.is_by_coordinate else ("shift_m", "turn_rad")
    numbers: dict[str, Any] = dict.fromkeys((*of_errors, *effect.figures), (Real, ...))
    return create_model(name, sigma=(_Sigma6, ...), **numbers) | None, None


_SHARED: dict[str, Any] = {name: _shared_entry(name, effect) for name, effect in RANDOM_EFFECTS.items()}
_AnyRobot: Any = create_model("_AnyRobot", __base__=_Robot, **_SHARED)


class _Noise(_Measured):
    correlated_px: Sigma | None = None
    cameras: dict[str, _Camera] | None = None
    robots: dict[str, _AnyRobot] | None = None
    clocks: dict[str, _Clock] | None = None
    targets: dict[str, _Target] | None = None


def _read(noise: _Noise | None) -> dict[str, Any]:
    return {} if noise is None else noise.model_dump(exclude_unset=True)


WrittenNoise = Annotated[Mapping[str, Any], as_written(_Noise | None, _read, dict)]
"""Sigmas by what they are of; those of `cameras`, `robots`, `clocks` and `targets` by name."""
