"""Another method beside a calibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from basecal.fields.file_forms import ErrorInDeg, ErrorInMm


@dataclass(frozen=True)
class Rival:
    """How well another method predicts the held-out views.

    Attributes:
        name: Of the method.
        target_m: Rms distance of `camera_from_target` from where the view alone has it [m]; None where it fails.
        target_rad: Likewise its rms angle [rad].
    """

    name: str
    target_m: Annotated[ErrorInMm, Field(alias="target_mm")] = None
    target_rad: Annotated[ErrorInDeg, Field(alias="target_deg")] = None
