"""Calibration targets: numbered points of a rigid body, and their printed patterns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from basecal.errors import InputError
from basecal.geometry import SE3, Array, IntArray, read_only, read_only_ids
from basecal.geometry.array import ReadOnlyArrays

Finder = Literal["charuco", "chessboard", "circles", "tags", "led"]


@dataclass(frozen=True, eq=False)
class Tags:
    """Tags whose corners are points of a target.

    Attributes:
        family: Dictionary or family of the tags.
        numbers: (m,) numbers of the tags in the family.
        corner_ids: (m, 4) ids of the corner points, clockwise from the top left of a tag as OpenCV draws it.
        border: Black cells between a tag's outer edge and its code.
        squares: Size of the black squares at the corners, relative to the tag's size; 0 if there are none.
    """

    family: str
    numbers: IntArray
    corner_ids: IntArray
    border: int = 1
    squares: float = 0.0


@dataclass(frozen=True, eq=False)
class Target(ReadOnlyArrays):
    """The points of a target in its own frame.

    Attributes:
        kind: Kind of the target, such as `charuco`.
        ids: (n,) ids of the points, in ascending order.
        points: (n, 3) [m] in the target's frame.
        options: Fields of the target in `cell.yaml`, as plain data.
        sheets: Printed sheets; empty for LEDs and measured points.
        found_by: Detector for images; None if the target is not detected in images.
        tags: The tags whose corners are the points; None if it has none.
        has_half_turn_symmetry: Whether the target looks the same after a rotation of 180 deg in its plane. The
            rotation maps point k to point n - 1 - k.
    """

    kind: str
    ids: IntArray
    points: Array
    options: Mapping[str, Any] = field(default_factory=dict)
    sheets: tuple[Sheet, ...] = ()
    found_by: Finder | None = None
    tags: Tags | None = None
    has_half_turn_symmetry: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", read_only_ids(self.ids))
        object.__setattr__(self, "points", read_only(self.points, (None, 3), "points_m"))

    @property
    def is_point(self) -> bool:
        """Whether the target is a single point, whose mount has a position and no rotation."""
        return len(self.points) == 1

    def rows(self, ids: IntArray) -> IntArray:
        """Indices of `ids` in `self.ids`, (m,).

        Raises:
            InputError: if an id is not on the target.
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
        dictionary: Name of the dictionary or family.
        number: Number of the marker in the dictionary.
        left: x of the left outer black edge on the sheet [m].
        top: y of the top outer black edge on the sheet [m].
        size_m: Distance between opposite outer black edges [m].
        border: Black cells between the outer edge and the code.
        turns: Quarter turns clockwise from OpenCV's drawing to the printed marker.
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
    """A flat print in its own axes: x right, y down, z into the print.

    Attributes:
        paper: Left, top, right and bottom of the white sheet, (4,) [m].
        pitch: Size of the pattern's unit: a square, a tag or a spacing [m].
        rectangles: Black rectangles, left, top, right, bottom, (n, 4) [m]; they do not overlap.
        discs: Black discs, centre x, y and radius, (n, 3) [m].
        markers: Markers on the white parts of the sheet.
        target_from_sheet: Pose of the sheet on the target.
    """

    paper: Array
    pitch: float
    rectangles: Array = field(default_factory=lambda: _no_shapes(4))
    discs: Array = field(default_factory=lambda: _no_shapes(3))
    markers: tuple[Marker, ...] = ()
    target_from_sheet: SE3 = field(default_factory=SE3.identity)


def black_squares(columns: int, rows: int, square_m: float, parity: int = 0) -> Array:
    """Squares of a board with (column + row) % 2 == parity: left, top, right, bottom, (n, 4) [m] from its corner."""
    row, column = np.mgrid[0:rows, 0:columns]
    black = (row + column) % 2 == parity
    corner = np.stack([column[black], row[black]], -1) * square_m
    return np.concatenate([corner, corner + square_m], -1)
