"""Drawing of printed sheets, with the black cells of markers as rectangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell.target import Marker, Sheet, Target
from basecal.errors import InputError
from basecal.geometry import Array
from basecal.vision.kinds.preprocessing import black_cells


def target_drawing(target: Target) -> tuple[Sheet, ...]:
    """The sheets of a printed target, with markers replaced by rectangles.

    Raises:
        InputError: if the target is not printed, or its dictionary cannot be drawn.
    """
    if not target.sheets:
        raise InputError(f"a target of kind {target.kind!r} is not printed")
    black = [np.concatenate([sheet.rectangles, *map(_cells, sheet.markers)]) for sheet in target.sheets]
    return tuple(replace(sheet, rectangles=each, markers=()) for sheet, each in zip(target.sheets, black, strict=True))


def _cells(marker: Marker) -> Array:
    """Black cells of a marker as rectangles, joined along each row, (n, 4) [m]."""
    black = np.rot90(black_cells(marker.dictionary, marker.number, marker.border), -marker.turns)
    cell = marker.size_m / len(black)
    steps = np.diff(np.pad(black.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    (row, start), (_, end) = np.nonzero(steps == 1), np.nonzero(steps == -1)
    left, top = marker.left, marker.top
    return np.stack([left + start * cell, top + row * cell, left + end * cell, top + (row + 1) * cell], -1)
