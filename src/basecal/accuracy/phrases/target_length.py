"""The true size of a target in the fields that state it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from basecal.cell import Cell


def as_written(cell: Cell, name: str, factor: float) -> str:
    """A clause with the first length among a target's fields times a factor; empty without one, such as points."""
    shape = cell.targets[name].target
    lengths = _lengths({} if shape is None else scale_lengths(shape.options, factor))
    return next((f": {field} would be {value:.5g}" for field, value in lengths), "")


def scale_lengths(fields: Mapping[str, Any], factor: float) -> dict[str, Any]:
    """A target's fields with all lengths, of tags in a list too, times a factor, to the digits that a size has."""
    return {key: _scale(value, factor, key.endswith("_m")) for key, value in fields.items()}


def _scale(value: Any, factor: float, is_length: bool) -> Any:
    if isinstance(value, Mapping):
        return scale_lengths(value, factor)
    if isinstance(value, list | tuple):
        return [_scale(each, factor, is_length) for each in value]
    return float(f"{value * factor:.5g}") if is_length else value


def _lengths(fields: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Fields that are one length, those of tags in a list too."""
    for key, value in fields.items():
        if key.endswith("_m") and isinstance(value, float):
            yield key, value
        for inner in value if isinstance(value, list) else ():
            if isinstance(inner, Mapping):
                yield from _lengths(inner)
