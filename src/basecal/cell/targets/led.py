"""One or several LEDs on a rigid body."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from basecal.cell.format.plain import numbers
from basecal.cell.target import Target
from basecal.cell.targets.kind import KindDescription, TargetEntry, TargetKind
from basecal.cell.targets.points import has_several_points
from basecal.fields.values import PointMount, UnknownEntry, Vector

_AT_ORIGIN = [[0.0, 0.0, 0.0]]


def led_target(points_m: Any = _AT_ORIGIN) -> Target:
    """Target of LEDs at points (n, 3) [m]; by default one LED at the origin."""
    points = np.asarray(points_m, dtype=np.float64)
    return Target("led", np.arange(len(points)), points, {"points_m": numbers(points)}, found_by="led")


class LedEntry(TargetEntry):
    """A single LED."""

    mount: PointMount = UnknownEntry()
    kind: Literal["led"]
    points_m: Annotated[list[Vector], Field(min_length=1, max_length=1)] | None = None

    def shape(self) -> Target:
        """Return the target."""
        return led_target(self.points_m or _AT_ORIGIN)


class LedsEntry(TargetEntry):
    """Several LEDs on one rigid body."""

    kind: Literal["led"]
    points_m: Annotated[list[Vector], Field(min_length=2)]

    def shape(self) -> Target:
        """Return the target."""
        return led_target(self.points_m)


KIND = TargetKind(
    entries=(LedEntry, LedsEntry),
    entry_index=has_several_points,
    description=KindDescription("as `points`; without it one point", "index", "as listed; the one point"),
    template="""\
    kind: led                        # one LED at the target's origin; several: points_m: [[0, 0, 0], ...]
""",
    usual=lambda _: led_target(),
    printed=lambda _: {},
)
