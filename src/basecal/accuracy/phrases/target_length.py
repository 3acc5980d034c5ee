"""Scaling of the lengths in the fields of a target."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from basecal.cell import Cell


def corrected_length_clause(cell: Cell, name: str, factor: float) -> str:
    """Clause with a target's first length field times a factor; empty if there is none, such as for points."""
    shape = cell.targets[name].target
    lengths = _lengths({} if shape is None else scale_lengths(shape.options, factor))
    return next((f": {field} would be {value:.5g}" for field, value in lengths), "")


def scale_lengths(fields: Mapping[str, Any], factor: float) -> dict[str, Any]:
    """Multiply all lengths of a target's fields, and of tags in a list, by a factor; rounded to five digits."""
    return {key: _scale(value, factor, key.endswith("_m")) for key, value in fields.items()}


def _scale(value: Any, factor: float, is_length: bool) -> Any:
    if isinstance(value, Mapping):
        return scale_lengths(value, factor)
    if isinstance(value, list | tuple):
        return [_scale(each, factor, is_length) for each in value]
    return float(f"{value * factor:.5g}") if is_length else value


def _lengths(fields: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Fields with a single length, including those of tags in a list."""
    for key, value in fields.items():
        if key.endswith("_m") and isinstance(value, float):
            yield key, value
        for inner in value if isinstance(value, list) else ():
            if isinstance(inner, Mapping):
                yield from _lengths(inner)
