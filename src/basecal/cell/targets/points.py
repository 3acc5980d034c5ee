"""Measured points of a rigid body, such as LEDs that another program identifies."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from pydantic import model_validator as checks_whole

from basecal.cell.format.plain import numbers
from basecal.cell.target import Target
from basecal.cell.targets.kind import Fields, KindDescription, TargetEntry, TargetKind
from basecal.fields.values import PointMount, UnknownEntry, Vector


def points_target(points_m: Any) -> Target:
    """Target of points of a rigid body, (n, 3) [m]; ids are the indices."""
    points = np.asarray(points_m, dtype=np.float64)
    return Target("points", np.arange(len(points)), points, {"points_m": numbers(points)})


class PointEntry(TargetEntry):
    """One point."""

    mount: PointMount = UnknownEntry()
    kind: Literal["points"]
    points_m: Annotated[list[Vector], Field(min_length=1, max_length=1)] | None = None

    @checks_whole(mode="after")
    def _has_point(self) -> PointEntry:
        if self.points_m is None:
            raise ValueError("kind points needs points_m: [[x, y, z], ...]")
        return self

    def shape(self) -> Target:
        """Return the target."""
        return points_target(self.points_m)


class PointsEntry(TargetEntry):
    """Several points of one body."""

    kind: Literal["points"]
    points_m: Annotated[list[Vector], Field(min_length=2)]

    def shape(self) -> Target:
        """Return the target."""
        return points_target(self.points_m)


def has_several_points(fields: Fields) -> bool:
    """Whether an entry has more than one point."""
    points = fields.get("points_m")
    return isinstance(points, list) and len(points) > 1


def _random_target(rng: np.random.Generator) -> Target:
    """Target of five to eight jittered corners of a cube, which are never coplanar."""
    corners = np.stack(np.meshgrid(*[[-0.06, 0.06]] * 3), -1).reshape(-1, 3)
    kept = rng.permutation(8)[: rng.integers(5, 9)]
    return points_target(corners[kept] + rng.uniform(-0.02, 0.02, (len(kept), 3)))


KIND = TargetKind(
    entries=(PointEntry, PointsEntry),
    entry_index=has_several_points,
    description=KindDescription("`points_m: [[x, y, z], ...]`", "index in the list", "as listed"),
    template="""\
    kind: points
    points_m: [[0, 0, 0], [0.08, 0, 0], [0, 0.08, 0], [0.08, 0.08, 0.03]]   # ids count from 0
""",
    usual=_random_target,
)
