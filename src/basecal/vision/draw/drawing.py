"""What is printed: the black shapes of a target, flat sheet by flat sheet, in metres."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from basecal.cell.target import Target
from basecal.errors import InputError
from basecal.geometry import SE3, Array, BoolArray
from basecal.vision.kinds.fiducial import black_cells, marker_corners

# In cells; one is what a reader needs, two keep what is beside the paper out of a blurred corner.
_TAG_MARGIN = 2
CIRCLE_RADIUS = 0.25
"""Radius of a circle in units of the spacing."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """A flat print in its own axes: x right, y down, seen from the side that z points away from.

    Attributes:
        target_from_sheet: Where it is on the target.
        paper: Left, top, right and bottom of the white sheet, (4,) [m].
        pitch: Size of what is drawn on it: a square, a tag or a spacing [m].
        rectangles: Black: left, top, right, bottom, (n, 4) [m]; they do not overlap.
        discs: Black: centre x, y and radius, (n, 3) [m].
    """

    target_from_sheet: SE3
    paper: Array
    pitch: float
    rectangles: Array
    discs: Array


def target_drawing(target: Target) -> tuple[Sheet, ...]:
    """The sheets of a printed target.

    Raises:
        InputError: if the target is not printed (points, led), or its dictionary cannot be drawn.
    """
    if target.kind not in _DRAWN:
        raise InputError(f"a target of kind {target.kind!r} is not printed; there are: {', '.join(_DRAWN)}")
    return _DRAWN[target.kind](target)


def _sheet(
    paper: tuple[float, float, float, float],
    pitch: float,
    rectangles: Array,
    discs: Array | None = None,
    pose: SE3 | None = None,
) -> Sheet:
    none = np.zeros((0, 3))
    return Sheet(pose or SE3.identity(), np.array(paper), pitch, rectangles, none if discs is None else discs)


def _black_squares(columns: int, rows: int, square: float, parity: int) -> Array:
    """Squares (column, row) of a board with (column + row) % 2 == parity, (n, 4) [m] from its outer corner."""
    row, column = np.mgrid[0:rows, 0:columns]
    black = (row + column) % 2 == parity
    corner = np.stack([column[black], row[black]], -1) * square
    return np.concatenate([corner, corner + square], -1)


def _cells(black: BoolArray, left: float, top: float, size: float) -> Array:
    """Black cells joined along each row, (n, 4) [m], of a marker whose outer corner is (left, top)."""
    cell = size / len(black)
    steps = np.diff(np.pad(black.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    (row, start), (_, end) = np.nonzero(steps == 1), np.nonzero(steps == -1)
    return np.stack([left + start * cell, top + row * cell, left + end * cell, top + (row + 1) * cell], -1)


def _charuco(target: Target) -> tuple[Sheet, ...]:
    of = target.options
    (columns, rows), square = of["squares"], of["square_m"]
    shifted = bool(of.get("legacy_pattern", False)) and rows % 2 == 0
    shapes = [_black_squares(columns, rows, square, parity=int(shifted))]
    for marker, corners in enumerate(marker_corners(target)):
        left, top = corners[0]
        shapes.append(_cells(black_cells(of["dictionary"], marker), left, top, of["marker_m"]))
    margin = square / 2
    paper = (-margin, -margin, columns * square + margin, rows * square + margin)
    return (_sheet(paper, square, np.concatenate(shapes)),)


def _chessboard(target: Target) -> tuple[Sheet, ...]:
    (columns, rows), square = target.options["corners"], target.options["square_m"]
    black = _black_squares(columns + 1, rows + 1, square, parity=0) - square
    return (_sheet((-2 * square, -2 * square, (columns + 1) * square, (rows + 1) * square), square, black),)


def _circles(target: Target) -> tuple[Sheet, ...]:
    spacing = target.options["spacing_m"]
    centres = target.points[:, :2]
    low, high = centres.min(axis=0) - spacing, centres.max(axis=0) + spacing
    discs = np.column_stack([centres, np.full(len(centres), CIRCLE_RADIUS * spacing)])
    return (_sheet((low[0], low[1], high[0], high[1]), spacing, np.zeros((0, 4)), discs),)


def _apriltag(target: Target) -> tuple[Sheet, ...]:
    sheets = []
    for number, size, target_from_tag in target.options["tags"]:
        black = black_cells(target.options["family"], number)
        half, margin = size / 2, _TAG_MARGIN * size / len(black)
        edge = half + margin
        cells = _cells(black, -half, -half, size)
        sheets.append(_sheet((-edge, -edge, edge, edge), size, cells, pose=target_from_tag))
    return tuple(sheets)


_DRAWN: dict[str, Callable[[Target], tuple[Sheet, ...]]] = {
    "charuco": _charuco,
    "chessboard": _chessboard,
    "circles": _circles,
    "apriltag": _apriltag,
}
