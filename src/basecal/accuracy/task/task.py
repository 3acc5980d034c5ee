"""Places of the task, and the transforms that relate robots there."""

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
    """Names of the requested transforms `reference_base_from_...`, which place a base, camera or target there."""
    return [name for name in cell.requested_transforms if name.startswith(f"{cell.reference}_base_from_")]


def require_placed_transforms(cell: Cell) -> list[str]:
    """Return `placed_transforms`, of which at least one is required.

    Raises:
        InputError: if there is no such transform.
    """
    names = placed_transforms(cell)
    if not names:
        raise InputError(
            f"the task point is in {cell.reference}_base, but no transform into that base is to be calibrated. "
            "Omit the task point, or set the pose of its base, camera or target to `status: free`"
        )
    return names


def box_points(box: Box) -> list[Point]:
    """Return the middle and the eight corners of a box that is given by two opposite corners."""
    edges = [(low, high) for low, high in zip(box[:3], box[3:], strict=True)]
    x, y, z = ((low, (low + high) / 2, high) for low, high in edges)
    return [(x[1], y[1], z[1]), *product(x[::2], y[::2], z[::2])]


def place_kind(points_m: Array) -> PlaceKind:
    """Kind of task for points of `task_places`, (n, 3)."""
    if not len(points_m):
        return "recorded places"
    return "task point" if len(points_m) == 1 else "task box"


def task_places(point: Point | None, box: Box | None) -> Array:
    """Points of the task in the reference's base, (n, 3) [m]: `box_points`, or the point; (0, 3) without either."""
    points = [] if point is None else [point]
    return np.array(points if box is None else box_points(box), dtype=np.float64).reshape(-1, 3)
