"""The target of a camera: named points of a rigid body, and how they are printed and seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from basecal.errors import InputError
from basecal.geometry import SE3, Array, IntArray, read_only, read_only_ids

Finder = Literal["charuco", "chessboard", "circles", "tags", "light"]


@dataclass(frozen=True, eq=False)
class Tags:
    """Tags whose corners are points of a target.

    Attributes:
        family: Their dictionary or family.
        numbers: (m,) which of the family.
        corner_ids: (m, 4) ids of the points at their corners, clockwise from the top left of a tag as OpenCV draws it.
        border: Black cells between a tag's outer edge and its code.
        squares: Size of the black squares that touch the corners, of a tag's; 0 for none.
    """

    family: str
    numbers: IntArray
    corner_ids: IntArray
    border: int = 1
    squares: float = 0.0


@dataclass(frozen=True, eq=False)
class Target:
    """The points of a target in its own frame.

    Attributes:
        kind: What it is.
        ids: (n,) names of the points, rising.
        points: (n, 3) [m] in the target's frame.
        options: The fields of `cell.yaml` it was made from, as plain data.
        sheets: What is printed; nothing of lights and measured points.
        found_by: How it is found in images; None if it is not.
        tags: The tags that its points are corners of, where it has any.
        alike_turned: Whether it looks the same turned by half a turn in its plane: point k is then point n - 1 - k.
    """

    kind: str
    ids: IntArray
    points: Array
    options: Mapping[str, Any] = field(default_factory=dict)
    sheets: tuple[Sheet, ...] = ()
    found_by: Finder | None = None
    tags: Tags | None = None
    alike_turned: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", read_only_ids(self.ids))
        object.__setattr__(self, "points", read_only(self.points, (None, 3), "points_m"))

    @property
    def is_point(self) -> bool:
        """Whether it is one point, whose mount has a position and no rotation."""
        return len(self.points) == 1

    def rows(self, ids: IntArray) -> IntArray:
        """Where `ids` stand among `self.ids`, (m,).

        Raises:
            InputError: if one is not on the target.
        """
        rows = np.searchsorted(self.ids, ids).clip(max=len(self.ids) - 1)
        missing = ids[self.ids[rows] != ids]
        if len(missing):
            known = f"{self.ids[0]} to {self.ids[-1]}"
            raise InputError(f"id {missing[0]} is not on the {self.kind}, whose ids are {known}")
        return rows


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
