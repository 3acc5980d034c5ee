"""Printed sheets of a target: flat, with black shapes and markers, in metres."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from basecal.geometry import SE3, Array


@dataclass(frozen=True)
class Marker:
    """A square marker of a dictionary.

    Attributes:
        dictionary: Name of its dictionary or family.
        number: Which of the dictionary.
        left: Its outer black edge on the sheet [m].
        top: Likewise [m].
        size_m: Outer black edge to outer black edge.
        border: Black cells between its outer edge and its code.
        turns: Quarter turns clockwise by which it is printed against how OpenCV draws it.
    """

    dictionary: str
    number: int
    left: float
    top: float
    size_m: float
    border: int = 1
    turns: int = 0


def _no_shapes(columns: int) -> Array:
    return np.zeros((0, columns))


@dataclass(frozen=True, eq=False)
class Sheet:
    """A flat print in its own axes: x right, y down, seen from the side that z points away from.

    Attributes:
        paper: Left, top, right and bottom of the white sheet, (4,) [m].
        pitch: Size of what is drawn on it: a square, a tag or a spacing [m].
        rectangles: Black: left, top, right, bottom, (n, 4) [m]; they do not overlap.
        discs: Black: centre x, y and radius, (n, 3) [m].
        markers: Printed on the white of the sheet.
        target_from_sheet: Where it is on the target.
    """

    paper: Array
    pitch: float
    rectangles: Array = field(default_factory=lambda: _no_shapes(4))
    discs: Array = field(default_factory=lambda: _no_shapes(3))
    markers: tuple[Marker, ...] = ()
    target_from_sheet: SE3 = field(default_factory=SE3.identity)


def black_squares(columns: int, rows: int, square_m: float, parity: int = 0) -> Array:
    """Squares (column, row) of a board with (column + row) % 2 == parity, (n, 4) [m] from its outer corner."""
    row, column = np.mgrid[0:rows, 0:columns]
    black = (row + column) % 2 == parity
    corner = np.stack([column[black], row[black]], -1) * square_m
    return np.concatenate([corner, corner + square_m], -1)
