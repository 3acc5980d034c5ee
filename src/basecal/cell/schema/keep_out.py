"""Entries of `cell.yaml` for boxes and tables that robots must not enter."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import model_validator as checks_whole

from basecal.cell.cell import KeepOut
from basecal.cell.format.plain import numbers, pose_dict
from basecal.fields.values import Number, PoseEntry, Vector, given_fields, pose_se3
from basecal.geometry import SE3, read_only

_TABLE_M = 20.0  # side of the box that represents a table: larger than any cell


class KeepOutEntry(PoseEntry):
    """A box by its centre and `size_m`, or everything below `table_z_m`, in the reference robot's base."""

    size_m: Vector | None = None
    table_z_m: Number | None = None

    @checks_whole(mode="after")
    def _check_kind(self) -> KeepOutEntry:
        if self.table_z_m is not None:
            if self.size_m is not None or given_fields(self):
                raise ValueError("expected table_z_m alone: a table has no size_m and no pose")
        elif self.size_m is None or not {"t_m", "matrix"} & set(given_fields(self)):
            raise ValueError("expected size_m and t_m of a box, or table_z_m of a table")
        elif min(self.size_m) <= 0:
            raise ValueError(f"size_m: expected three lengths above 0, got {self.size_m}")
        return self

    def box(self, name: str) -> KeepOut:
        """Return the box; a table is a box below its surface."""
        if self.table_z_m is not None:
            world_from_box = SE3(np.eye(3), np.array([0.0, 0.0, self.table_z_m - 0.5 * _TABLE_M]))
            return KeepOut(name, world_from_box, read_only([_TABLE_M] * 3, (3,), "size_m"))
        assert self.size_m is not None
        return KeepOut(name, pose_se3(self), read_only(self.size_m, (3,), "size_m"))


def keep_out_dict(box: KeepOut) -> dict[str, Any]:
    """Convert a box to plain data; reading the data gives the same box."""
    return {**pose_dict(box.world_from_box), "size_m": numbers(box.size_m)}
