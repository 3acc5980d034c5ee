"""Where the work is done, and which transforms bring a point there from one robot to another."""

from __future__ import annotations

from itertools import product

import numpy as np

from basecal.cell import Cell
from basecal.cell.work_error import PlaceKind
from basecal.errors import InputError
from basecal.geometry import Array

Point = tuple[float, float, float]
Box = tuple[float, float, float, float, float, float]


def placed_transforms(cell: Cell) -> list[str]:
    """The requested transforms that place something in the reference's base, as work between robots needs it."""
    return [name for name in cell.requested_transforms if name.startswith(f"{cell.reference}_base_from_")]


def base_transforms(cell: Cell) -> list[str]:
    """As `placed_transforms`.

    Raises:
        InputError: if there is none.
    """
    names = placed_transforms(cell)
    if not names:
        raise InputError(
            f"a task point is in {cell.reference}_base, and nothing that is placed there is to be calibrated. "
            "Leave the task point out, or set the base, camera or target that it concerns to `status: free`"
        )
    return names


def box_points(box: Box) -> list[Point]:
    """The middle of a box, given by two opposite corners, and its corners."""
    edges = [(low, high) for low, high in zip(box[:3], box[3:], strict=True)]
    x, y, z = ((low, (low + high) / 2, high) for low, high in edges)
    return [(x[1], y[1], z[1]), *product(x[::2], y[::2], z[::2])]


def place_kind(points_m: Array) -> PlaceKind:
    """The kind of `task_places`, (n, 3)."""
    if not len(points_m):
        return "recorded places"
    return "task point" if len(points_m) == 1 else "task box"


def task_places(point: Point | None, box: Box | None) -> Array:
    """Where the work is done in the reference's base, (n, 3) [m]: `box_points`, or the point; (0, 3) without either."""
    points = [] if point is None else [point]
    return np.array(points if box is None else box_points(box), dtype=np.float64).reshape(-1, 3)
