"""What a camera looks at: named points of a rigid body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from basecal.errors import InputError
from basecal.geometry import SE3, Array, IntArray, read_only, read_only_ids

Kind = Literal["points", "led", "charuco", "chessboard", "circles", "apriltag"]


@dataclass(frozen=True, eq=False)
class Target:
    """The points of a target in its own frame.

    Attributes:
        kind: What it is.
        ids: (n,) names of the points, rising.
        points: (n, 3) [m] in the target's frame.
        options: The fields of `cell.yaml` it was made from.
    """

    kind: Kind
    ids: IntArray
    points: Array
    options: Mapping[str, Any] = field(default_factory=dict)

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


def _grid(columns: int, rows: int, pitch: float, origin: float = 0.0) -> Array:
    """Row-major grid in the plane z = 0, (rows * columns, 3): x along columns, y along rows."""
    v, u = np.mgrid[0:rows, 0:columns]
    return np.stack([u.ravel() * pitch + origin, v.ravel() * pitch + origin, np.zeros(u.size)], -1)


def _made(kind: Kind, points: Array, ids: IntArray | None = None, **options: Any) -> Target:
    numbered = np.arange(len(points)) if ids is None else ids
    return Target(kind, read_only_ids(numbered), read_only(points, (None, 3), "points_m"), options)


def points(points_m: Any) -> Target:
    """Points of a rigid body, (n, 3) [m]; ids are their indices."""
    return _made("points", np.asarray(points_m, dtype=np.float64), points_m=points_m)


def led(points_m: Any = ((0.0, 0.0, 0.0),)) -> Target:
    """One light or several, (n, 3) [m]; without points, one at the frame's origin."""
    return _made("led", np.asarray(points_m, dtype=np.float64), points_m=points_m)


def charuco(
    squares: tuple[int, int], square_m: float, marker_m: float, dictionary: str, legacy_pattern: bool = False
) -> Target:
    """A ChArUco board of (columns, rows) squares; ids are OpenCV's corner ids, the origin the outer corner."""
    columns, rows = squares
    grid = _grid(columns - 1, rows - 1, square_m, origin=square_m)
    options: dict[str, Any] = {"squares": squares, "square_m": square_m, "marker_m": marker_m, "dictionary": dictionary}
    return _made("charuco", grid, **options, legacy_pattern=legacy_pattern)


def chessboard(corners: tuple[int, int], square_m: float) -> Target:
    """A chessboard of (columns, rows) inner corners; the origin is corner 0."""
    return _made("chessboard", _grid(*corners, square_m), corners=corners, square_m=square_m)


def circles(circles: tuple[int, int], spacing_m: float, asymmetric: bool = False) -> Target:
    """A grid of (columns, rows) circles; ids are row-major, the origin is circle 0.

    In an asymmetric grid every second row is shifted by half a column pitch of twice `spacing_m`, as in OpenCV.
    """
    columns, rows = circles
    grid = _grid(columns, rows, spacing_m)
    if asymmetric:
        row = np.repeat(np.arange(rows), columns)
        grid[:, 0] = 2 * grid[:, 0] + (row % 2) * spacing_m
    return _made("circles", grid, circles=circles, spacing_m=spacing_m, asymmetric=asymmetric)


def apriltag(family: str, tags: list[tuple[int, float, SE3]]) -> Target:
    """Tags as (id, size [m], target_from_tag); corner ids are 4 * tag + corner.

    Corners go round from the tag's top left as it is read, clockwise; x right, y down, z into the tag.
    """
    corners = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float64)
    ordered = sorted(tags, key=lambda tag: tag[0])
    all_points = np.concatenate([pose @ (size * corners) for _, size, pose in ordered])
    ids = np.concatenate([4 * number + np.arange(4) for number, _, _ in ordered])
    return _made("apriltag", all_points, ids, family=family, tags=tuple(ordered))
