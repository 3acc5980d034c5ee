"""Options in `cell.yaml` of a UR controller."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from basecal.fields.values import Entry


class UrOptions(Entry):
    """Options of `kind: ur`.

    Attributes:
        host: Host name or IP address of the controller.
        motion: Whether the arm is moved by program (`move`), led in freedrive (`freedrive`), or only read (`watch`).
        rate_hz: Rate of states [Hz].
        acceleration_rad_s2: Acceleration of the leading joint of a move.
        reconnect_s: Timeout for re-establishing a lost connection [s].
    """

    host: Annotated[str, Field(min_length=1)]
    motion: Literal["move", "freedrive", "watch"] = "move"
    rate_hz: Annotated[float, Field(ge=10, le=500)] = 125.0
    acceleration_rad_s2: Annotated[float, Field(gt=0, le=10)] = 0.5
    reconnect_s: Annotated[float, Field(ge=0, le=3600)] = 10.0
