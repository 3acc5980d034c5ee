"""The true size of a target in the field that states it."""

from __future__ import annotations

from basecal.cell import Cell


def as_written(cell: Cell, name: str, factor: float) -> str:
    """A clause with the first length among a target's fields times a factor; empty without one, such as points."""
    shape = cell.targets[name].target
    for field, value in ({} if shape is None else shape.options).items():
        if field.endswith("_m") and isinstance(value, float):
            return f": {field} would be {value * factor:.5g}"
    return ""
