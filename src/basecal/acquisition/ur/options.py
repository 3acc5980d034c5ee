"""Options in `cell.yaml` of a UR controller."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from basecal.fields.values import Entry


class UrOptions(Entry):
    """Options beside `kind: ur`.

    Attributes:
        host: Name or number of the controller in the network.
        motion: Whether it is sent (`move`), led with the arm in freedrive (`freedrive`), or only watched (`watch`).
        rate_hz: How often states come.
        acceleration_rad_s2: Of the leading joint of a move.
        reconnect_s: How long a connection that is lost is tried again.
    """

    host: Annotated[str, Field(min_length=1)]
    motion: Literal["move", "freedrive", "watch"] = "move"
    rate_hz: Annotated[float, Field(ge=10, le=500)] = 125.0
    acceleration_rad_s2: Annotated[float, Field(gt=0, le=10)] = 0.5
    reconnect_s: Annotated[float, Field(ge=0, le=3600)] = 10.0
